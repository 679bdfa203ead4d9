"""What all tasks share.

| what | where |
|---|---|
| gymnasium environments: one robot, many robots | `single`, `vector` |
| their settings, and in which form actions are taken | `settings`, `interface` |
| compiling before the first of all episodes | `precompile` |
| batched robots: drive, sense, map, observe | `robots`; their arrays: `state` |
| the state of a robot, for another to go on from | `episode_snapshot` |
| what actions ask for | `actions` |
| what is observed | `observation`, `observation_builder` |
| the same, compiled | `observation_kernels`, `observation_parts` |
| ground covered, rooms entered | `coverage`, `rooms`; compiled: `coverage_kernels` |
| ways over ground that robots have seen | `wayfinding`; compiled: `wayfinding_kernels` |
| the true way home | `way_home` |
| rewards as named terms | `reward` |
| what lies behind a robot when an episode begins | `journeys` |
"""
