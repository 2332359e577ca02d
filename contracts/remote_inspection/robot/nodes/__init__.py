"""The rover's nodes: plain classes whose `step` takes the inputs of the contract and returns its outputs."""
