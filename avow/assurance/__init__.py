"""The assurance case: what the evidence says of every claim, held against the policy; nothing here runs a tool.

`case` builds the one frozen `Case` (`model`) from obligations, ledger and plan; `gates` decides the exit code; `codec`
writes and reads cases.
"""
