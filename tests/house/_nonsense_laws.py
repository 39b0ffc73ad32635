"""Right arguments of the friction laws, the contacts and the reference systems."""

import numpy as np

import stickslip.contact as contact
import stickslip.derived as derived
import stickslip.friction as friction
import stickslip.systems as systems
from stickslip import FixedStep, Integrator
from stickslip.mechanism import AbstractMechanism
from tests.house._nonsense_target import Target, arg

POSITIVE = ("positive", "float32", "batch")
NOT_NEGATIVE = ("not negative", "float32", "batch")
FINITE = ("finite", "float32", "batch")
DRY = friction.Coulomb(0.4)


def positive(**values):
    """Parameters that must be positive."""
    return {name: arg(value, *POSITIVE) for name, value in values.items()}


def not_negative(**values):
    """Parameters that must not be negative."""
    return {name: arg(value, *NOT_NEGATIVE) for name, value in values.items()}


def finite(**values):
    """Parameters that must be finite."""
    return {name: arg(value, *FINITE) for name, value in values.items()}


LAWS = [
    Target(
        friction.Coulomb,
        {"mu_s": arg(0.4, *NOT_NEGATIVE), "mu_k": arg(0.3, "none", *NOT_NEGATIVE)},
    ),
    Target(
        friction.Stribeck,
        {**not_negative(mu_s=0.4, mu_k=0.3), **positive(v_s=0.01, exponent=2)},
    ),
    Target(
        friction.HyperbolicWeakening,
        {**not_negative(mu_s=0.4, gamma=1.0), "mu_k": arg(0.3, "none", *NOT_NEGATIVE)},
    ),
    Target(
        friction.SmoothHyperbolicWeakening,
        {**not_negative(mu_0=0.26, beta=0.9, gamma=1.75), **positive(alpha=190.0)},
    ),
    Target(friction.ViscousFriction, not_negative(mu_v=0.1)),
    Target(friction.ViscousDamping, not_negative(c=0.1)),
    Target(
        friction.Regularised,
        {
            "law": arg(DRY), **positive(v_reg=1e-3), "kind": arg("tanh"),
            "v_brk": arg(1e-2, "none", *POSITIVE),
        },
    ),
    Target(
        friction.Dahl,
        {"law": arg(DRY), **positive(sigma_0=1e4), "exponent": arg(1, "positive", "float32")},
    ),
    Target(
        friction.LuGre,
        {
            "law": arg(DRY), **positive(sigma_0=1e4), **not_negative(sigma_1=1.0, sigma_2=0.0),
            "v_s": arg(1e-2, "none", *POSITIVE),
        },
    ),
    Target(
        friction.RateAndState,
        {
            **not_negative(mu_0=0.6), **finite(b=0.01), "evolution": arg("slip"),
            **positive(a=0.009, d_c=1e-5, v_0=1e-6, v_rest=1e-20),
        },
    ),
    Target(friction.Asymmetric, {"forward": arg(DRY), "backward": arg(DRY)}),
    Target(friction.Sum, {"laws": arg(DRY)}, lambda laws: friction.Sum(DRY, laws)),
    Target(friction.check_friction_law, {"law": arg(DRY), "speeds": arg([0.1, 1.0], "none", "row")}),
]  # fmt: skip

PROBLEM = {
    "mass_matrix": arg(np.eye(2)),
    "force": arg([3.0, 1.5], "row"),
    "normals": arg(np.array([[1.0, 0.0], [0.0, 1.0]])),
}
LIMITS = arg([1.0, 2.0], "row")
MASK = arg(np.array([True, True]), "none", "mask")
CONTACTS = [
    Target(contact.vector_dead_zone, {**PROBLEM, "limits": LIMITS, "active": MASK}),
    Target(contact.zonotope_vertices, {"normals": arg(np.eye(2)), "limits": LIMITS}),
]  # fmt: skip

SMOOTH = friction.SmoothHyperbolicWeakening(0.26, 190.0, 0.9, 1.75)
MECHANICS = {
    **positive(m=0.2, M=0.2, J=0.04, r=0.25, g=9.81),
    **not_negative(k1=17.0, k2=11.0, k3=85.0, c1=1.0, c2=0.03),
    **finite(Q=-0.4),
}
BEAM = {
    **positive(m=0.1, k1=0.25, k2=7.6),
    **not_negative(k3=22.8, mu_s=0.3, gamma=10.0, damping=0.0),
    **finite(v=5e-4),
    "z_A": arg(0.4, "float32", "batch"),
    "modes": arg(5),
    "law": arg(None, "none"),
    "scales": arg(None, "none"),
    **dict.fromkeys(("joint", "friction", "shape", "coupling"), arg("printed")),
}
DRIVE_WORDS = {"motor_friction": arg("printed"), "belt_reaction": arg("printed")}
BLOCK = systems.BlockOnDrivenBelt.constructed(k3=85.0)
OSCILLATOR = systems.CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
SYSTEMS = [
    Target(
        systems.OscillatorBetweenStops,
        {
            **positive(mass=1.0, stiffness=1.0),
            "lower": arg(-1.0, "finite", "float32", "batch"),
            "upper": arg(1.0, "finite", "float32", "batch"),
            "restitution": arg(0.5, "zero", "float32", "batch"),
            **not_negative(damping=0.1, rest_speed=1e-3),
            **finite(force_amplitude=0.0, force_frequency=1.0),
        },
    ),
    Target(
        systems.BouncingBall,
        {
            **positive(mass=1.0, gravity=9.81), "restitution": arg(0.5, "zero", "float32", "batch"),
            **not_negative(rest_speed=1e-3),
        },
    ),
    Target(
        systems.CoulombOscillator,
        {
            **positive(mass=1.0, stiffness=1.0), **not_negative(static_force=1.0, kinetic_force=0.5),
            **finite(belt_speed=0.2),
        },
    ),
    Target(
        systems.SlidingBlock,
        {
            **positive(mass=1.0), **not_negative(static_force=1.0, kinetic_force=0.5),
            **finite(force=0.2),
        },
    ),
    Target(
        systems.TwoBlocksOnBelt,
        {
            **positive(mass_1=1.0, mass_2=1.0),
            **not_negative(
                stiffness_1=1.0, stiffness_2=1.0, coupling=1.0, static_force_1=1.0, static_force_2=1.0,
                kinetic_force_1=0.5, kinetic_force_2=0.5,
            ),
            **finite(belt_speed=0.2),
        },
    ),
    *(
        Target(kind, {**MECHANICS, "law": arg(law), **finite(V_b=0.1)})
        for kind, law in ((systems.BlockOnBelt, SMOOTH), (systems.BlockOnBeltSetValued, DRY))
    ),
    *(
        Target(kind, {**MECHANICS, "law": arg(law), "drive": arg(systems.DCDrive.constructed())})
        for kind, law in (
            (systems.BlockOnDrivenBelt, SMOOTH),
            (systems.BlockOnDrivenBeltSetValued, DRY),
        )
    ),
    *(
        Target(kind.constructed, not_negative(k3=85.0))
        for kind in (
            systems.BlockOnBelt, systems.BlockOnBeltSetValued, systems.BlockOnDrivenBelt,
            systems.BlockOnDrivenBeltSetValued,
        )
    ),
    Target(
        systems.DCDrive,
        {
            **positive(L_w=2e-3, R_w=2.0, J_dc=5e-5, rho=20.0, eta=0.6, r_bp=0.03),
            **not_negative(k_e=0.05, k_m=0.05, b=2e-5, T_k=5e-3, J_bp=1e-4),
            **finite(U_in=4.0),
            "T_st": arg(6e-3, "none", *NOT_NEGATIVE),
            **DRIVE_WORDS,
        },
    ),
    Target(AbstractMechanism.state, finite(x=0.0, v=0.0), OSCILLATOR.state),
    Target(AbstractMechanism.bristles, {"kind": arg(friction.LuGre)}, OSCILLATOR.bristles),
    Target(systems.DCDrive.constructed, {**finite(U_in=4.0), **DRIVE_WORDS}),
    Target(systems.JointedBeam, BEAM),
    Target(systems.JointedBeam.constructed, finite(v=5e-4)),
    Target(systems.JointedBeam.printed, finite(v=5e-4)),
    Target(systems.BeamScales, positive(EI=1.0, L=1.0, rhoA=1.0)),
    Target(
        systems.mean_belt_speed,
        {
            "system": arg(BLOCK), "transient": arg(1.0, "positive", "float32"),
            "duration": arg(1.0, "positive", "float32"),
            "integrator": arg(Integrator("tsit5", FixedStep(1e-3)), "none"),
        },
    ),
    Target(
        systems.voltage_for_belt_speed,
        {
            "system": arg(BLOCK), "speed": arg(0.12, "positive", "float32"),
            "tolerance": arg(1e-9, "positive", "float32"),
        },
    ),
    Target(
        derived.WithIntegrals,
        {
            "system": arg(OSCILLATOR), "integrands": arg(systems.CoulombOscillator.powers, "function"),
            "units": arg({"belt": "J"}, "none", "mapping"),
        },
    ),
]  # fmt: skip
TARGETS = [*LAWS, *CONTACTS, *SYSTEMS]
