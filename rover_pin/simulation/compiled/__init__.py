"""The compiled step, as Python uses it: the contact and motor laws as generated C code, and the numbers of rover and
terrain that the C code of the step reads.

Start at `kernel`, which combines these laws and numbers with the C code of the step. `laws` and `body_law` contain the
CasADi functions that are compiled; `toolchain` compiles C code and stores the libraries.
"""
