"""What is declared wrongly is refused by its name, before anything is compiled."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb, Dahl, LuGre, Regularised, Sum, ViscousFriction
from stickslip.mechanism import AbstractMechanism, Contact, DeclarationError
from stickslip.systems import BouncingBall, CoulombOscillator, Motion

DRY = Coulomb(1.0, 0.5)


def declared(
    coordinates=None, directions=None, mass=(1.0, 2.0), force=(0.0, 0.0), contacts=None, **attributes
):
    """A machine of two coordinates with one contact, and what is changed of it."""
    names = {"x": "m", "y": "m"} if coordinates is None else coordinates
    given = {"pad": {"x": 1}} if directions is None else directions

    class Machine(AbstractMechanism):
        coordinates = names
        contact_directions = given

        def mass_matrix(self, q):
            return mass(q) if callable(mass) else mass

        def forces(self, t, q, v, args):
            return force(t, q, v) if callable(force) else force

        def contacts(self, t, q, v, args):
            if contacts is None:
                return {"pad": Contact(DRY)}
            return contacts(t, q, v) if callable(contacts) else contacts

    return type("Machine", (Machine,), attributes)()


def wave(i):
    return {"pad": {f"x_{i}": 1}}


CONSTRUCTED = {
    "direction of the wrong length": (dict(directions={"pad": (1, 0, 0)}), r"\['pad'\].*2 entries"),
    "direction along no coordinate": (dict(directions={"pad": {"z": 1}}), r"\['pad'\].*'x', 'y'"),
    "direction zero": (dict(directions={"pad": (0, 0)}), r"\['pad'\].*not all of them 0"),
    "direction NaN": (dict(directions={"pad": (np.nan, 1)}), r"\['pad'\].*finite"),
    "direction a text": (dict(directions={"pad": ("a", 1)}), r"\['pad'\].*constant numbers"),
    "direction a plane": (dict(directions={"pad": ({"x": 1}, {"y": 1})}), r"\['pad'\].*in a plane"),
    "direction two rows": (dict(directions={"pad": ((1, 0, 0), (0, 1, 0), 0)}), "in a plane"),
    "mass negative": (dict(mass=(1.0, -2.0)), r"mass_matrix\(q\)\['y'\].*-2\.0"),
    "mass zero": (dict(mass=(0.0, 2.0)), r"mass_matrix\(q\)\['x'\]"),
    "mass NaN": (dict(mass=(np.nan, 2.0)), r"mass_matrix\(q\)\['x'\]"),
    "mass left out": (dict(mass={"x": 1.0}), r"mass_matrix\(q\)\['y'\]"),
    "masses of three": (dict(mass=(1.0, 2.0, 3.0)), r"mass_matrix\(q\).*2 entries"),
    "mass of no coordinate": (dict(mass={"x": 1.0, "z": 2.0}), r"mass_matrix\(q\).*'x', 'y'"),
    "matrix not symmetric": (dict(mass=((1.0, 0.5), (0.0, 1.0))), r"mass_matrix\(q\).*symmetric"),
    "matrix indefinite": (dict(mass=((1.0, 2.0), (2.0, 1.0))), r"mass_matrix\(q\).*positive definite"),
    "matrix of three": (dict(mass=np.eye(3)), r"mass_matrix\(q\).*shape \(2, 2\)"),
    "matrix with a short row": (dict(mass=((1.0, 0.1), (0.1,))), r"mass_matrix\(q\)\['y'\]"),
    "matrix with a number for a row": (dict(mass=((1.0, 0.1), 1.0)), r"mass_matrix\(q\)"),
    "no coordinates": (dict(coordinates={}), "coordinates.*at least one"),
    "coordinates without units": (dict(coordinates=("x", "y")), "coordinates.*mapping"),
    "coordinate no identifier": (dict(coordinates={"x 1": "m", "y": "m"}), "x 1.*identifiers"),
    "coordinate a word of Python": (
        dict(coordinates={"lambda": "m", "y": "m"}, directions={"pad": {"y": 1}}),
        "lambda.*identifiers",
    ),
    "velocity of no coordinate": (dict(velocities={"z": "w"}), "velocities.*'z'"),
    "velocity no identifier": (dict(velocities={"x": "v x"}), "velocities.*'v x'"),
    "velocity named as a coordinate": (dict(velocities={"x": "y"}), "velocities.*'y'"),
    "coordinate named as a velocity": (dict(coordinates={"x": "m", "v_x": "m"}), "velocities.*'v_x'"),
    "two velocities of one name": (dict(velocities={"x": "w", "y": "w"}), "velocities.*'w'"),
    "contact with the joint of names": (dict(directions={"a / b": (1, 0)}), "directions.*a / b"),
    "opening contact that is none": (dict(opening=("lid",)), "opening.*'lid'.*'pad'"),
    "too many contacts": (
        dict(directions={f"c{i}": (1, 0) for i in range(32)}), "contact_directions.*32.*at most 31",
    ),
    "dependent direction given later": (
        dict(directions={"pad": (1, 0), "lid": None, "belt": (0, 1)}), "pad, lid, belt.*constant",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CONSTRUCTED)
def test_refused_where_it_is_made(case):
    changes, message = CONSTRUCTED[case]
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        declared(**changes)
    assert "\n" not in str(caught.value).strip()


def test_an_entry_that_cancels_may_be_of_rounding():
    declared(mass=((1.0, 2e-18), (-3e-18, 4.0)))


def pad(**changes):
    return {"pad": Contact(**{"law": DRY, **changes})}


STARTED = {
    "normal force negative": (dict(contacts=pad(normal_force=-1.0)), "normal force.*'pad'.*-1"),
    "normal force NaN": (dict(contacts=pad(normal_force=np.nan)), "normal force.*'pad'.*nan"),
    "bristles": (dict(contacts=pad(law=LuGre(Coulomb(1.0), 1e4))), r"'pad'.*bristles\(\)"),
    "Dahl": (dict(contacts=pad(law=Dahl(Coulomb(1.0), 1e4))), r"'pad'.*bristles\(\)"),
    "smooth law": (dict(contacts=pad(law=Regularised(DRY, 1e-3))), r"'pad'.*regularised\(\)"),
    "viscous law alone": (dict(contacts=pad(law=ViscousFriction(0.1))), "'pad'.*set-valued"),
    "no law": (dict(contacts=pad(law=0.3)), "'pad'.*friction law"),
    "no Contact": (dict(contacts={"pad": DRY}), r"contacts.*'pad'.*Contact"),
    "missing contact": (dict(contacts={}), "contacts.*'pad'"),
    "contact too many": (dict(contacts={**pad(), "lid": Contact(DRY)}), "contacts.*'pad'"),
    "contacts too many": (dict(contacts=[Contact(DRY)] * 2), "contacts.*1 entries.*pad"),
    "no contacts": (dict(contacts=lambda t, q, v: None), "contacts"),
    "force of no coordinate": (dict(force={"z": 1.0}), "force.*'z'.*'x', 'y'"),
    "forces of three": (dict(force=(1.0, 2.0, 3.0)), "force.*2 entries"),
    "no force": (dict(force=lambda t, q, v: None), "force.*None"),
    "surface speed by velocity": (
        dict(contacts=lambda t, q, v: pad(surface_speed=0.1 * v.y)), "surface_speed.*'pad'.*velocities",
    ),
    "direction by velocity": (
        dict(directions={"pad": None}, contacts=lambda t, q, v: pad(direction=(1.0, v.x))),
        "direction.*'pad'.*velocities",
    ),
    "direction of the wrong length": (
        dict(directions={"pad": None}, contacts=pad(direction=(1.0, 0.0, 0.0))), "'pad'.*2 entries",
    ),
    "direction not given": (dict(directions={"pad": None}), r"'pad'.*direction"),
    "push along no coordinate": (
        dict(contacts=pad(normal_direction={"z": 1})), "'pad'.*normal_direction.*'x', 'y'",
    ),
    "dependent surfaces that speed up": (
        dict(
            directions={"pad": (1, 1), "lid": (1, 1)},
            contacts=lambda t, q, v: {**pad(surface_speed=jnp.sin(t)), "lid": Contact(DRY)},
        ),
        "pad.*constant speed",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", STARTED)
def test_refused_where_a_run_begins(case):
    changes, message = STARTED[case]
    machine = declared(**changes)
    with pytest.raises((ValueError, TypeError), match=message) as caught:
        ss.simulate(machine, 0.0, 1.0, machine.state())
    assert "\n" not in str(caught.value).strip()


def test_a_mode_in_which_what_slides_would_stick():
    """It would be carried along at that speed, without a word."""
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    with pytest.raises(ValueError, match=r"mode0 = 'stick', and it slides at -0\.2: .*contact 'belt'"):
        ss.simulate(block, 0.0, 1.0, Motion(0.0, 0.0), "stick")
    block.check_start(0.0, Motion(0.0, 0.2 * (1.0 + 1e-9)), 1, None)  # rounding
    ball = BouncingBall(0.5, 9.81, 0.7, 0.02)
    with pytest.raises(ValueError, match=r"mode0 = 'rest', and its gap is 1: .*stop 'ground' is open"):
        ss.simulate(ball, 0.0, 1.0, Motion(1.0, 0.0), "rest")
    with pytest.raises(ValueError, match=r"mode0 = 'rest', and its gap changes at -1: "):
        ss.simulate(ball, 0.0, 1.0, Motion(0.0, -1.0), "rest")
    ball.check_start(0.0, Motion(0.0, 0.0), 1, None)


def test_a_fast_rotor_hides_no_sliding():
    """Measured against all velocities, 0.01 beside 1e5 was rounding, and stuck."""
    machine = declared()
    with pytest.raises(ValueError, match=r"mode0 = 'stick', and it slides at 0\.01: "):
        ss.simulate(machine, 0.0, 1.0, machine.state(v_x=1e-2, v_y=1e5), "stick")
    ss.simulate(machine, 0.0, 1.0, machine.state(v_y=1e5), "stick")


def test_laws_that_a_smooth_form_does_not_take():
    bristly = declared(contacts=pad(law=LuGre(Coulomb(1.0), 1e4)))
    with pytest.raises(DeclarationError, match=r"'pad'.*bristles\(\)"):
        ss.simulate(bristly.regularised(1e-3), 0.0, 1.0, bristly.state())
    both = declared(contacts=pad(law=Sum(Coulomb(1.0, 0.5), ViscousFriction(0.1))))
    with pytest.raises(DeclarationError, match=r"'pad', in Dahl.*equal at rest"):
        both.bristles(Dahl, sigma_0=1e4).start(both.state())


def test_states_by_name():
    machine = declared(velocities={"y": "w"})
    assert machine.state(x=1.0, w=2.0)._fields == ("x", "y", "v_x", "w")
    with pytest.raises(TypeError, match=r"'z'.*x, y, v_x, w"):
        machine.state(z=1.0)
    with pytest.raises(ValueError, match="x = nan"):
        machine.state(x=np.nan)


def test_an_inertia_that_vanishes_where_the_coordinates_are_zero():
    """Polar coordinates: m and m r^2, positive definite where the motion is."""
    machine = declared(mass=lambda q: (1.0, q.x**2), force=lambda t, q, v: (q.x * v.y**2 - q.x, 0.0))
    run = ss.simulate(machine, 0.0, 1.0, machine.state(x=1.0, v_y=1.0))
    assert float(run.y1.x) == pytest.approx(1.0, abs=1e-9)
    with pytest.raises(ValueError, match=r"mass_matrix\(q\)\['y'\]"):
        ss.simulate(machine, 0.0, 1.0, machine.state(v_y=1.0))


@pytest.mark.more
@pytest.mark.parametrize(
    ("load", "guard"), [(0.3, "pad loses its normal force"), (0.0, "pad stops or gives way")]
)
def test_a_normal_force_that_vanishes_ends_the_run(load, guard):
    """Of a contact that does not open; one that bears nothing gives way at the same instant."""
    machine = declared(
        mass=(1.0, 1.0),
        force=lambda t, q, v: (load, -1.0),
        contacts=lambda t, q, v: pad(normal_force=1.0 + q.y),
    )
    run = ss.simulate(machine, 0.0, 5.0, machine.state(), throw=False)
    assert run.result == ss.RESULTS.no_admissible_mode
    np.testing.assert_allclose(run.t1, np.sqrt(2.0), rtol=1e-9)
    last = int(run.events.guard[int(run.num_events) - 1])
    assert machine.guard_names[last] == guard


def test_names_of_modes():
    machine = declared(directions={f"c{i}": (1, 0) for i in range(3)})
    names = machine.mode_names
    assert len(names) == 64
    assert names[names.index("stick / slip forward / slip backward")] == (
        "stick / slip forward / slip backward"
    )
    assert jax.tree.leaves(machine) == []
