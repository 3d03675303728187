"""Types of numbers in a scenario, with their bounds."""

from typing import Annotated

from msgspec import Meta

DAY = 86_400.0  # s, longer than any mission

Side = Annotated[float, Meta(ge=1, le=20_000)]  # m
Length = Annotated[float, Meta(ge=0.01, le=200)]  # m
Speed = Annotated[float, Meta(ge=0.01, le=100)]  # m/s
Time = Annotated[float, Meta(ge=0, le=DAY)]  # s
Density = Annotated[float, Meta(ge=1e-15, le=1000)]  # per m²
Probability = Annotated[float, Meta(ge=0, le=1)]
Count = Annotated[int, Meta(ge=0, le=10_000)]
Expected = Annotated[float, Meta(ge=0, le=10_000)]  # number of trees or people
Weight = Annotated[float, Meta(ge=0, le=100)]
Variance = Annotated[float, Meta(ge=1e-3, le=1e8)]  # m²
Footprint = Annotated[float, Meta(ge=0.01, le=10_000)]  # m
Scans = Annotated[int, Meta(ge=1)]
Point = tuple[float, float]
Path = Annotated[tuple[Point, ...], Meta(max_length=1000)]  # waypoints, m
Paths = Annotated[tuple[Path, ...], Meta(max_length=10_000)]
