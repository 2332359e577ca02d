"""Runs a node's own source, step by step, without a robot: what `steps` does for classes with a `step` method.

Its modules run in the subject's process, beside code that is not ours: they import nothing of Avow.
"""
