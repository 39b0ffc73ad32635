"""All that a mechanism says about one dry contact at one instant."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp

from stickslip._types import Given
from stickslip._validation import DeclarationError, refusal
from stickslip.friction import AbstractFrictionLaw
from stickslip.hybrid.dependence import NONE, degrees

from ._declaration import in_order


class Contact(NamedTuple):
    r"""One dry contact at one instant, as `AbstractMechanism.contacts` returns it.

    With the direction $n$ of the contact its sliding speed is $u = n \cdot v - w$ [m/s], and friction
    acts on the velocities with the force $n\,\lambda$, $-\lambda \in \mu(u) N + d(u)$ [N].

    - `law`: the friction law, one of `stickslip.friction`.
    - `normal_force` $N$ [N]; 1 if left out, so that the coefficients of the law are forces.
    - `surface_speed` $w$ [m/s]: speed of the counter surface along the contact; 0 if left out.
    - `direction` $n$: a row of numbers or a mapping from coordinates, where `contact_directions` of
      the mechanism holds None because it depends on the state or on parameters.
    - `normal_direction`: the generalised force of a normal force of 1 N on the mechanism, likewise;
      only for a contact that may open, since it vanishes with the contact.
    - `rest_speed` $s_0$ [m/s], positive, of the first of two contacts that are one in a plane
      (`AbstractMechanism.planar`); others have none. The direction of such a slide settles as its speed
      goes to zero, ever faster. Slower than $s_0$ it goes on under the forces of that instant, for the
      time $T \approx s_0/(\mu g)$. Forces that change by themselves within $\tau$ leave an error of
      $T^2/\tau$ of the time of the stop and $s_0 T^2/\tau$ of its place; two coefficients or joined
      inertia one of a part of $T$ and $s_0 T$. One that passes zero against its load, nearer than
      $s_0$, is right to a part of $s_0$. It should be more than 1e-11 of the largest speed, and on
      fixed steps $h$ more than $\mu g h$.
    """

    law: Given[AbstractFrictionLaw]
    normal_force: Any = 1.0
    surface_speed: Any = 0.0
    direction: Any = None
    normal_direction: Any = None
    rest_speed: Any = 1e-6


def drags(law: Any) -> bool:
    """Whether a law resists without a normal force too."""
    return degrees(lambda u: [law.drag(u)], (jnp.zeros(()),), (True,)) != [NONE]


def contacts_in_order(names: tuple[str, ...], given: Any) -> list[Contact]:
    """The contacts in the order of their names; raises for what is not one, or has no friction law."""
    if isinstance(given, Mapping):
        missing = [name for name in names if name not in given]
        if missing:
            raise refusal("contacts(t, q, v, args)", sorted(given), f"a Contact for {missing[0]!r} too")
    contacts = in_order("contacts(t, q, v, args)", given, names, "a Contact for each") if names else []
    for name, contact in zip(names, contacts, strict=True):
        if not isinstance(contact, Contact):
            raise refusal(f"contacts(...)[{name!r}]", contact, "a Contact", TypeError)
        if not isinstance(contact.law, AbstractFrictionLaw):
            what = f"the law of contact {name!r}"
            raise DeclarationError(
                str(refusal(what, contact.law, "a friction law of stickslip.friction"))
            )
    return contacts
