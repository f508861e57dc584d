"""A code behind a command: it is given a scene as files, and the files that it writes become a run.

The contract, with formulas and examples, is docs/guide/own_code.md; its files are described by the models of
`reference.process.contract`, published as JSON schemas (`gpudem schema scene`, `gpudem schema run`).
"""

from reference.process.runner import Process, code_of

__all__ = ["Process", "code_of"]
