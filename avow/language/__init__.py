"""RCL, the ROS Contract Language: text in, checked contract out.

Front doors: `avow.language.load` (files and formulas), `avow.language.contract` and `avow.language.terms` (what comes
of them), `avow.language.translate` (other notations). Within: `lexer`, `outline` and `parser` make the syntax tree,
`checker` gives it types, `lints` warns, `format` lays it out.
"""
