"""The assurance case: the status that the evidence gives every claim, compared with the policy; nothing here runs a
tool.

`case` builds the one frozen `Case` (`model`) from obligations, ledger and plan; `gates` decides the exit code; `codec`
writes and reads cases.
"""
