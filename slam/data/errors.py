"""What goes wrong with a user's input, said in one line."""


class InputError(Exception):
    """A user's mistake or a broken file: the message names the file, what is wrong with it and what to do.

    The command line prints the message alone and exits with 1.
    """
