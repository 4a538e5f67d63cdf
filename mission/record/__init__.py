"""What a run leaves behind: frames, telemetry, summary and report."""
