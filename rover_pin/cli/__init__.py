"""The command line. `app` holds the main commands, and `commands` has one file for each further command.

A command parses its options, calls one public function of the package, and prints the result. Start at `app`. `options`
defines the options that several commands share, and `terminal` formats the output.
"""
