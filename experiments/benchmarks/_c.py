"""C written by hand, compiled for this machine."""

import atexit
import ctypes
import functools
import pathlib
import shutil
import subprocess
import tempfile

# No -ffast-math: the exponential needs its order of operations. What is here changes no value but by
# contraction to fused multiply-adds.
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=fast")
_folder = tempfile.TemporaryDirectory(prefix="stickslip-bench-")
atexit.register(_folder.cleanup)


class CompilerAbsentError(RuntimeError):
    """There is no C compiler, or it does not take the file."""


@functools.cache
def compiled(source: pathlib.Path, name: str, header: str, flags: tuple[str, ...] = ()) -> ctypes.CDLL:
    """The library of a C file that includes `header` as `job.h`; `name` is that of the build."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        raise CompilerAbsentError("no C compiler")
    folder = pathlib.Path(_folder.name, name)
    folder.mkdir()
    (folder / "job.h").write_text(header)
    library = folder / "job.so"
    command = [
        compiler, *FLAGS, *flags, "-Wno-psabi", "-fopenmp", "-fPIC", "-shared", f"-I{folder}",
        str(source), "-o", str(library), "-lm",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise CompilerAbsentError(f"{compiler}: {done.stderr.strip()[-300:]}")
    return ctypes.CDLL(str(library))
