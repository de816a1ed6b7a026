"""The changes that are made: one or two for each operator, none that cannot but fail."""

from __future__ import annotations

_SWAPPED = {
    "BinaryOperator": (
        "Add_Sub",
        "Sub_Add",
        "Mul_Div",
        "Div_Mul",
        "Pow_Mul",
        "FloorDiv_Div",
        "Mod_Mul",
        "BitAnd_BitOr",
        "BitOr_BitAnd",
    ),
    "ComparisonOperator": (
        "Eq_NotEq",
        "NotEq_Eq",
        "Lt_LtE",
        "Lt_GtE",
        "LtE_Lt",
        "LtE_Gt",
        "Gt_GtE",
        "Gt_LtE",
        "GtE_Gt",
        "GtE_Lt",
        "Is_IsNot",
        "IsNot_Is",
    ),
    "UnaryOperator": ("Delete_USub", "Delete_Not", "Delete_Invert"),
}
_OTHERS = (
    "AddNot",
    "NumberReplacer",  # one more and one less
    "ReplaceAndWithOr",
    "ReplaceBreakWithContinue",
    "ReplaceContinueWithBreak",
    "ReplaceFalseWithTrue",
    "ReplaceOrWithAnd",
    "ReplaceTrueWithFalse",
    "ZeroIterationForLoop",
)

OPERATORS = frozenset(f"core/Replace{kind}_{swap}" for kind in _SWAPPED for swap in _SWAPPED[kind])
OPERATORS |= frozenset(f"core/{name}" for name in _OTHERS)
"""Cosmic Ray's names of the operators in use."""
