"""The paper's tables from our own runs: `python -m benchmarks.paper_tables TABLE`.

Runs are saved one by one and not repeated; a table says at which scale they were made, and calls
undecided what differs less than the runs do among themselves.
"""
