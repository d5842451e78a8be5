"""Process of one run: flies the job that comes on standard input.

It inherits nothing of a run before it, as an application's modules may keep state. The reason of a
failure goes to standard output, a pipe to the process that started it; all that is printed
goes to standard error, a file.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys

from aerodaas.cli.application import run_application
from aerodaas.cli.failure import failure_of, show_failure
from aerodaas.cli.seeds.job import Job
from aerodaas.environment.signals import heed_interrupts
from aerodaas.service.flights.tie import end_with_starter
from aerodaas.types.errors import IncompleteError


def main() -> None:
    """Fly; the exit code is that of `aerodaas run`, but for an incomplete mission.

    That is an outcome among others of the seeds, with figures of its own.
    """
    heed_interrupts()
    answer = os.dup(1)
    os.dup2(2, 1)
    job: Job = pickle.load(sys.stdin.buffer)  # noqa: S301 - from the process that started this one
    end_with_starter()
    try:
        run_application(job.application, job.words, job.options)
    except IncompleteError as error:
        show_failure(failure_of(error))
    except KeyboardInterrupt:
        sys.exit(128 + signal.SIGINT)
    except Exception as error:  # noqa: BLE001 - the application may raise anything
        failure = failure_of(error)
        show_failure(failure)
        os.write(answer, failure.text.encode(errors="replace"))
        sys.exit(failure.code)


if __name__ == "__main__":
    main()
