"""The parts that all tasks share.

| what | where |
|---|---|
| gymnasium environments: one robot, many robots | `single`, `vector` |
| their settings, and the form of actions and observations | `settings`, `interface` |
| compilation before the first episode | `precompile` |
| batched robots: drive, sense, map, observe | `robots`; their arrays: `state` |
| snapshots of a robot and of what it knows | `episode_snapshot` |
| actions | `actions` |
| observations | `observation`, `observation_builder` |
| the same, compiled | `observation_kernels`; the parts: `parts` |
| ground covered, rooms entered | `coverage`, `rooms`; compiled: `coverage_kernels` |
| paths over ground that robots have seen | `wayfinding`; compiled: `wayfinding_kernels` |
| the same to uncovered ground, compiled | `onward_kernels` |
| the true shortest path home | `way_home` |
| rewards as named terms | `reward` |
| outward journeys and tours before an episode begins | `journeys` |
"""
