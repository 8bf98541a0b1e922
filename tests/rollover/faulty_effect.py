"""An effect that does what a plug-in of one's own may do: ends its process, hangs, eats memory, raises, takes long."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

from ground.quantity import Quantity, parameters
from rollover.effects import Effect

FAULTS = ("", "abort", "hang", "memory", "raise", "parent")


@parameters
class Faulty(Effect):
    """Nothing, or a fault, by number."""

    fault: Annotated[float, Quantity("1", "0 for none, otherwise the place in FAULTS", least=0, most=5)] = 0.0
    wait: Annotated[float, Quantity("s", "that it takes", least=0)] = 0.0

    id = "faulty"
    family = "a fault"
    equation = "none"
    source = "made up for tests"
    sentence = "It does {fault}."
    null: ClassVar = {"fault": 0.0, "wait": 0.0}

    def changes(self, scenario: Any) -> Mapping[str, Any]:
        """Do it as soon as the scenario is set up."""
        if self.wait:
            time.sleep(self.wait)
        match FAULTS[int(self.fault)]:
            case "abort":
                os.abort()
            case "hang":
                threading.Event().wait()
            case "memory":
                held = []
                while True:
                    held.append(bytearray(100_000_000))
            case "raise":
                raise RuntimeError("a plug-in's own mistake")
            case "parent":
                asked = multiprocessing.parent_process()  # not who forked it
                os.kill(os.getppid() if asked is None or asked.pid is None else asked.pid, 9)
                threading.Event().wait()
        return {}
