"""What children of a drop's diagnosis need, imported and called once, for `execute.begin_server`."""

import gc

from rollover.dynamics.drop_test import DropModel
from rollover.scenario import load

DropModel(scenario=load("drop_test")).run()  # its kernels are loaded
gc.collect()
gc.freeze()  # what stays for good is not searched again and again by each child
