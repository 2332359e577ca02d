"""Runs a node's own program and judges it step by step, for every method that tests the program itself.

`cpython` runs a Python class in isolation; `samples` draws inputs at which something may change; `judging` evaluates a
step exactly against the contract.
"""
