"""What children need for drops of a study, imported and called once, for `processes.begin_server`."""

from rollover.studies.case import warm_up_before_fork

warm_up_before_fork("drop")
