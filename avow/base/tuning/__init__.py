"""The numbers by which Avow is tuned, each with its reason.

`effort`: time and solver steps of questions; `bounds`: how far searches go; `sizes`: the largest inputs that are read;
`running`: times of a run; `shown`: how much a person is shown. The first three can change an answer. A backend has its
own numbers in `tuning.py` in its own folder, the kernel in `avow.kernel.solvers`.
"""
