"""How programs that run once are compiled: cheaply. The quick suite does, and notebooks at quick size.

Most of their time is the compiler's. Results are those of a user's program to rounding.
"""

import jax

# To ask how often a loop turns, these copy the module once for each loop and round: 40% of the time of
# the compiler.
_PASSES_OVER_LOOPS = (
    "simplify-while-loops",
    "while-loop-constant-sinking",
    "while-loop-invariant-code-motion",
    "while-loop-trip-count-annotator",
)


def xla_flags() -> list[str]:
    """Flags that XLA reads when a process makes its first array."""
    flags = [f"--xla_disable_hlo_passes={','.join(_PASSES_OVER_LOOPS)}"]
    if jax.version.__version_info__ < (0, 11):
        # Newer compilers know only the emitters that take half of the time here.
        flags.append("--xla_cpu_use_fusion_emitters=false")
        # One module a program: cut into 32 for as many cores, each is optimised and linked apart.
        flags.append("--xla_cpu_parallel_codegen_split_count=1")
    return flags
