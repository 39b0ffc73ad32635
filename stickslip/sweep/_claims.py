"""Who computes which unit: claims by files that one process alone can make, alive while touched.

    STORE/claims/000011.0    made by exclusive creation; says who, and how long it is good for untouched
    STORE/claims/000011.1    whoever found the first one dead or given back; the highest has the unit
    STORE/claims/clock       touched to ask the file system for the time

No lock of the system is needed, which network file systems lack or lose, nor one time of all hosts:
the age of a claim is the difference of two times of the same file system. A claim of this very host
and boot whose process is gone is dead at once.

A claim that was taken for dead and was not, of a host that slept, say, costs time and nothing else:
both write the same bytes, in files of their own that are put in place whole.
"""

import contextlib
import json
import os
import pathlib
import platform
import random
import secrets
from collections.abc import Callable, Collection
from typing import Any, NamedTuple, Protocol, runtime_checkable

CLAIMS = "claims"
CLOCK = "clock"
LOOKS = 4  # claims of others that a worker looks at before each of its own
EXPIRY = 120.0  # s; network file systems may show times that are a minute old


@runtime_checkable
class Ground(Protocol):
    """Where claims are: files in a folder, or a simulation of them."""

    def now(self) -> float:
        """The time there, in seconds."""
        ...

    def names(self) -> list[str]:
        """What there is."""
        ...

    def create(self, name: str, text: str) -> bool:
        """Make it unless it is there; whether this was who made it."""
        ...

    def look(self, name: str) -> tuple[float, str] | None:
        """When it was touched, and what it says; `None` if it is not there."""
        ...

    def touch(self, name: str) -> bool:
        """Set its time to now; whether it is there."""
        ...

    def expire(self, name: str) -> None:
        """Set its time to long ago, if it is there."""
        ...

    def remove(self, name: str) -> None:
        """Remove it, if it is there."""
        ...


class Folder:
    """Claims as files."""

    def __init__(self, path: pathlib.Path):
        self.path = path

    def now(self) -> float:
        path = self.path / CLOCK
        with open(path, "ab") as file:
            os.utime(file.fileno() if os.utime in os.supports_fd else path)
            return os.fstat(file.fileno()).st_mtime

    def names(self) -> list[str]:
        try:
            return os.listdir(self.path)
        except (FileNotFoundError, NotADirectoryError):
            return []

    def create(self, name: str, text: str) -> bool:
        self.path.mkdir(exist_ok=True)
        path = self.path / name
        try:
            file = open(path, "xb")
        except FileExistsError:
            return False
        try:
            with file:
                file.write(text.encode())
        except BaseException:
            self.remove(name)
            raise
        return True

    def look(self, name: str) -> tuple[float, str] | None:
        # A network file system asks its server anew for a file that is opened.
        try:
            with open(self.path / name, "rb") as file:
                return os.fstat(file.fileno()).st_mtime, file.read(4096).decode("utf-8", "replace")
        except OSError:
            return None

    def touch(self, name: str) -> bool:
        try:
            os.utime(self.path / name)
        except FileNotFoundError:
            return False
        return True

    def expire(self, name: str) -> None:
        with contextlib.suppress(OSError):
            os.utime(self.path / name, (0, 0))

    def remove(self, name: str) -> None:
        with contextlib.suppress(OSError):
            os.unlink(self.path / name)


class Claim(NamedTuple):
    """One unit in one worker's hands."""

    unit: int
    generation: int
    token: str  # of this claim alone; marks the files that are written under it
    after: str  # token of the dead claim before it, or nothing

    @property
    def name(self) -> str:
        return _name(self.unit, self.generation)


class Standing(NamedTuple):
    """A claim as others see it."""

    generation: int
    seen: tuple[float, str]
    age: float
    alive: bool
    who: str
    token: str
    expiry: float


def this_process() -> dict[str, Any]:
    """Who claims, so that others on the same host and boot see whether the process is still there."""
    return {"host": platform.node(), "boot": _boot(), "pid": os.getpid()}


def is_gone(owner: dict[str, Any]) -> bool:
    """Whether this is a process of this host, boot and space of processes, and is not there."""
    pid = owner.get("pid")
    if not _boot() or owner.get("boot") != _boot() or not isinstance(pid, int) or pid <= 0:
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    except OSError:
        return False
    return False


def _boot() -> str:
    """Name of this start of this system as its processes see each other; nothing where unknown."""
    try:
        boot = pathlib.Path("/proc/sys/kernel/random/boot_id").read_text().strip()
        return f"{platform.node()} {boot} {os.stat('/proc/self/ns/pid').st_ino}"
    except OSError:
        return ""


class Claims:
    """The claims on a store's units, as one worker makes and sees them."""

    def __init__(
        self,
        place: pathlib.Path | Ground,
        *,
        expiry: float = EXPIRY,
        owner: dict[str, Any] | None = None,
        gone: Callable[[dict[str, Any]], bool] = is_gone,
    ):
        self.ground: Ground = Folder(place / CLAIMS) if isinstance(place, pathlib.Path) else place
        self.expiry = expiry
        self.owner = this_process() if owner is None else owner
        self.gone = gone
        self._chance = random.Random()

    def take(self, unit: int) -> Claim | None:
        """Claim a unit; `None` if it is in somebody's hands.

        Numbers of claims only grow until the unit is finished, so that of all who saw the same one dead
        or given back a single one makes the next. Whoever has a claim looks whether the unit was
        finished meanwhile: then its claims are gone, and numbers begin anew.
        """
        generation = max(self._generations(unit), default=None)
        held = None if generation is None else self._seen(unit, generation, self.ground.now())
        if generation is not None and (held is None or held.alive):
            return None
        generation, token = (0 if held is None else held.generation + 1), secrets.token_hex(4)
        text = json.dumps({**self.owner, "token": token, "expiry": self.expiry})
        if not self.ground.create(_name(unit, generation), text):
            return None
        return Claim(unit, generation, token, "" if held is None else held.token)

    def holds(self, claim: Claim) -> bool:
        """Whether nobody has taken the claim for dead, and nobody removed it."""
        highest = max(self._generations(claim.unit), default=-1)
        return highest == claim.generation and self._is_own(claim)

    def beat(self, claim: Claim) -> bool:
        """Show that the claim is alive; whether it is there."""
        return self._is_own(claim) and self.ground.touch(claim.name)

    def release(self, claim: Claim, *, finished: bool) -> None:
        """Give a unit back: for others to go on with, or finished."""
        if not self._is_own(claim):
            return
        if finished:
            for generation in sorted(self._generations(claim.unit)):
                self.ground.remove(_name(claim.unit, generation))
        else:
            self.ground.expire(claim.name)

    def candidates(self, todo: Collection[int], turn: int, looks: int = LOOKS) -> list[int]:
        """Which units to try: some whose worker is dead, then those that nobody claims, from `turn` on.

        Names alone say what is claimed. Of the claims only some, by chance, are looked at: a thousand
        workers who look at each other's every time would do nothing else, and each dead one is found by
        somebody soon.
        """
        claimed = self._claimed()
        free = sorted(set(todo) - claimed.keys())
        others = sorted(claimed.keys() & set(todo))
        some = self._chance.sample(others, min(looks, len(others)))
        now = self.ground.now() if some else 0.0
        seen = {unit: self._seen(unit, claimed[unit], now) for unit in some}
        dead = [unit for unit, standing in seen.items() if standing is None or not standing.alive]
        turn %= max(len(free), 1)
        return [*dead, *free[turn:], *free[:turn]]

    def _claimed(self) -> dict[int, int]:
        """Highest generation of the claims on each unit that has any."""
        highest: dict[int, int] = {}
        for parts in map(_parts, self.ground.names()):
            if parts is not None:
                highest[parts[0]] = max(highest.get(parts[0], -1), parts[1])
        return highest

    def standing(self) -> dict[int, Standing]:
        """What is claimed, by unit."""
        highest = self._claimed()
        if not highest:
            return {}
        now = self.ground.now()
        seen = {unit: self._seen(unit, generation, now) for unit, generation in highest.items()}
        return {unit: standing for unit, standing in seen.items() if standing is not None}

    def remove_dead(self) -> None:
        """Remove claims of the dead, where no worker is about."""
        for unit, standing in self.standing().items():
            if not standing.alive:
                for generation in sorted(self._generations(unit)):
                    self.ground.remove(_name(unit, generation))

    def _is_own(self, claim: Claim) -> bool:
        """Whether the file is still the one that this claim made: its name may have been given anew."""
        seen = self.ground.look(claim.name)
        return seen is not None and f'"{claim.token}"' in seen[1]

    def _generations(self, unit: int) -> list[int]:
        found = map(_parts, self.ground.names())
        return [parts[1] for parts in found if parts is not None and parts[0] == unit]

    def _seen(self, unit: int, generation: int, now: float) -> Standing | None:
        seen = self.ground.look(_name(unit, generation))
        if seen is None:
            return None
        try:
            owner = json.loads(seen[1])
        except (ValueError, RecursionError):
            owner = None
        if not isinstance(owner, dict):
            owner = {}  # not yet written, or damaged: good for as long as any
        expiry = owner.get("expiry")
        if isinstance(expiry, bool) or not isinstance(expiry, int | float) or not expiry > 0:
            expiry = self.expiry
        age = now - seen[0]
        who = f"process {owner.get('pid', '?')} on {owner.get('host', '?')}"
        alive = age <= expiry and not self.gone(owner)
        token = owner.get("token")
        token = token if isinstance(token, str) and token.isalnum() else ""
        return Standing(generation, seen, age, alive, who, token, float(expiry))


def _name(unit: int, generation: int) -> str:
    return f"{unit:06d}.{generation}"


def _parts(name: str) -> tuple[int, int] | None:
    unit, _, generation = name.partition(".")
    ok = unit.isdecimal() and generation.isdecimal() and unit.isascii() and generation.isascii()
    return (int(unit), int(generation)) if ok else None
