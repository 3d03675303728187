"""Made-up teams, which conformance checks, warm-up and tests share."""
