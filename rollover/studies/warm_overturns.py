"""What children need for overturns by the compiled loop, imported and called once, for `processes.begin_server`."""

from rollover.studies.case import warm_up_before_fork

warm_up_before_fork("full", "compiled")
