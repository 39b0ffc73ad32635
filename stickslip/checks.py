"""Arguments: their types, and checks that name them, their value and what is allowed.

For packages that are built on this one. A check is handed the name of an argument and its value,
returns the value, and lets pass what is traced. `Given[T]` marks a parameter that the callable checks
itself.
"""

from ._argument_checks import Check as Check
from ._argument_checks import check_arguments as check_arguments
from ._argument_checks import check_own_methods as check_own_methods
from ._argument_checks import modes as modes
from ._argument_checks import one_real as one_real
from ._argument_checks import reals as reals
from ._argument_checks import with_components as with_components
from ._types import Given as Given
from ._types import Numeric as Numeric
from ._types import Row as Row
from ._types import Whole as Whole
from ._validation import MOST as MOST
from ._validation import REAL as REAL
from ._validation import as_float64 as as_float64
from ._validation import as_parameter as as_parameter
from ._validation import check_between as check_between
from ._validation import check_callable as check_callable
from ._validation import check_count as check_count
from ._validation import check_finite as check_finite
from ._validation import check_flag as check_flag
from ._validation import check_handed_on as check_handed_on
from ._validation import check_in as check_in
from ._validation import check_increasing as check_increasing
from ._validation import check_known as check_known
from ._validation import check_mapping as check_mapping
from ._validation import check_nonnegative as check_nonnegative
from ._validation import check_positive as check_positive
from ._validation import check_type as check_type
from ._validation import is_concrete as is_concrete
from ._validation import numbers as numbers
from ._validation import one_concrete as one_concrete
from ._validation import one_number as one_number
from ._validation import one_row as one_row
from ._validation import refusal as refusal
from ._validation import shape_refusal as shape_refusal
from ._validation import whole_number as whole_number
