"""What children need for drops of a study, imported and called once, for `processes.begin_server`."""

import gc
from contextlib import suppress

from rollover.studies.case import warm_up
from rollover.system import own_code

with suppress(Exception), own_code.none_named():  # the first case will say what is wrong
    warm_up("drop")
gc.collect()
gc.freeze()  # what stays for good is not searched again and again by each child
