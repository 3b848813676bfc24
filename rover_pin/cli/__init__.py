"""The command line: `app` parses, calls one public function, prints; one file a command in `commands`.

Start at `app`; `terminal` formats what is printed.
"""
