"""The command ``contactd``: the program that Rust builds, as a function of the package's shared library."""

import signal
import sys

from ._native import _command_line


def main() -> None:
    """Runs the command with this process's arguments, and ends the process with its exit status."""
    if sys.argv[1:2] == ["batch"]:
        # Tables are read and written by Python's libraries, which come with `contactd[batch]`.
        try:
            from .shards import main as batch
        except ModuleNotFoundError as error:
            print(f'contactd batch: {error}: pip install "contactd[batch]"', file=sys.stderr)
            sys.exit(2)
        try:
            sys.exit(batch(sys.argv[2:]))
        except KeyboardInterrupt:
            sys.exit(130)
    # Python's own answers to signals are for Python programs: Ctrl-C ends a command, and where it serves, it is the server's.
    for number in (signal.SIGINT, signal.SIGXFSZ):
        signal.signal(number, signal.SIG_DFL)
    # How it is started again: -P, or a folder of this name where it is called would come first.
    again = [sys.executable, "-P", "-m", "contactd"]
    sys.exit(_command_line(["contactd", *sys.argv[1:]], again))


if __name__ == "__main__":
    main()
