"""What pyproject.toml cannot say: the folder `backends/` at the top level is the package `avow.backends`."""

from setuptools import find_packages, setup

backends = [f"avow.backends.{name}" for name in find_packages("backends")]

setup(packages=[*find_packages(include=["avow", "avow.*"]), *backends], package_dir={"avow.backends": "backends"})
