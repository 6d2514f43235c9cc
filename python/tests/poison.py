"""A plan with a row that kills its process, as a faulty FMU may, in a module that workers can import."""

import os
import signal
import time

import fmurun
import numpy as np


class Poisoned(fmurun.Plan):
    """Dies with SIGSEGV at the load of 0.666 N.m."""

    def _run_many(self, table, **more):
        if (np.asarray(table["tau_load"]) == 0.666).any():
            os.kill(os.getpid(), signal.SIGSEGV)
        return super()._run_many(table, **more)


class Full(fmurun.Plan):
    """Finds no space on the disk."""

    def _run_many(self, table, **more):
        if more.get("first_run"):
            with open("/dev/full", "wb") as file:
                file.write(bytes(1 << 20))
        return super()._run_many(table, **more)


class Held(fmurun.Plan):
    """After five parts in $FMURUN_HELD/out, a worker writes its process ID to $FMURUN_HELD and waits for $FMURUN_HELD/go."""

    def _run_many(self, table, **more):
        folder = os.environ["FMURUN_HELD"]
        out = os.path.join(folder, "out")
        if "first_run" in more and sum(name.startswith("part-") for name in os.listdir(out)) >= 5:
            open(os.path.join(folder, str(os.getpid())), "w").close()
            while not os.path.exists(os.path.join(folder, "go")):
                time.sleep(0.005)
        return super()._run_many(table, **more)
