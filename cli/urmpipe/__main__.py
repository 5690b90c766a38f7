"""The command `urmpipe`, and `python -m urmpipe`."""

import signal


def main() -> None:
    """Run the command line; until that is loaded there is nothing to tell, and Ctrl-C ends it in silence."""
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    from urmpipe.main import main as run_command_line

    signal.signal(signal.SIGINT, before)
    run_command_line()


if __name__ == "__main__":
    main()
