"""What pages and recordings both show: entities of the channels, answers in words, differences."""
