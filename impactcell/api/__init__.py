"""What a notebook calls, in one line each; the command line stands on the same functions.

`impactcell` itself offers these names, looked up when they are first asked for.
"""
