"""What the rule files compute from the configuration: sequences, source digests, the record of builds."""
