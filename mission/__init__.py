"""What happens next: the mission language, its executive, the behaviours and the record of a run."""
