"""Errors of user input, with a one-line message."""


class InputError(Exception):
    """A user's mistake or a damaged file; the message names the file, the fault and the remedy.

    The command line prints only the message and exits with code 1.
    """
