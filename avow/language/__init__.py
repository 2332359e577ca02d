"""RCL, the ROS Contract Language: text in, checked contract out.

Start reading at: `avow.language.load` (files and formulas), `avow.language.contract` and `avow.language.terms` (the
results), `avow.language.translate` (other notations). `lexer`, `outline` and `parser` build the syntax tree, `checker`
types it, `lints` warns, `format` formats it.
"""
