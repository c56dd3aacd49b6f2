"""The command line: parsing, progress and printing; no mathematics."""

import sys

from workbench.cli.leaving import INTERRUPTED, Interrupted, Signals, Terminated, held
from workbench.cli.streams import explain, failure, nowhere, prepare, tell, unprinted

CLOSED = 1  # the exit code if nobody reads on, as after `| head -1`
TERMINATED = INTERRUPTED.replace("interrupted", "terminated")


def main() -> None:
    """Run a command. Errors of ours are a sentence and exit code 2, an interrupt is 130, and a
    request to terminate 143. An output that cannot be written is a sentence and exit code 2. If the
    reader of a pipe has closed it, nothing is said and the exit code is 1.
    """
    prepare()
    if nowhere():
        tell("error: the folder that this command was started in is gone; change to another one")
        sys.exit(2)
    signals, mistake = Signals(), None
    try:
        code, sentence = _run(signals)
    except Exception as error:
        code, sentence, mistake = 1, "", error
    wrong = failure(sys.stdout) or unprinted(mistake)
    if isinstance(wrong, BrokenPipeError):
        code, sentence = code or CLOSED, ""
    elif wrong is not None:
        code = code if code > 1 else 2
        sentence = f"cannot write to the standard output: {wrong.strerror or wrong}"
    elif mistake is not None and signals.asked is KeyboardInterrupt:
        code, sentence = 130, INTERRUPTED  # C code made another error of the interrupt
    elif mistake is not None:
        raise mistake
    if sentence:
        tell(sentence)
    sys.exit(code)


def _run(signals: Signals) -> tuple[int, str]:
    """The exit code, and what is left to be said. Raises what is a mistake in the workbench."""
    try:
        with signals:
            with held():
                from workbench.cli.app import app
            app()
    except Interrupted as leaving:
        return 130, str(leaving)
    except KeyboardInterrupt:
        return 130, INTERRUPTED
    except Terminated as leaving:
        return 143, str(leaving) or TERMINATED
    except SystemExit as leaving:  # Typer's, also of an interrupt while it reads the arguments
        code = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
        return code, INTERRUPTED if code == 130 else ""
    except Exception as error:
        if not explain(error):
            raise
        return 2, ""
    return 0, ""
