"""Export of a control as C code, with test vectors for the comparison of the C code with the Python control."""
