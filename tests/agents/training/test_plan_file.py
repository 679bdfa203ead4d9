"""Plans in YAML: what is wrong with one is said where it stands."""

from __future__ import annotations

import dataclasses
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from albot_agents.task import is_probe, task_names, untwinned
from albot_agents.training.plan import StagePlan, TrainingPlan, parse_schedule
from albot_agents.training.plan_file import (
    evaluation_settings,
    read_plan,
    save_plan,
    shipped_plan,
    stage_settings,
)
from albot_core.errors import InputError
from albot_core.plain_data import Location
from tests.agents.training.tiny import TASK, plan_file

SHIPPED = sorted(
    file.name.removesuffix(".yml")
    for file in (resources.files("albot_agents.training") / "configs").iterdir()
)


def test_every_task_has_a_plan() -> None:
    tasks = {name for name in task_names() if not is_probe(name) and untwinned(name) == name}
    assert {f"Albot/{name}" for name in SHIPPED} == tasks


@pytest.mark.parametrize("name", SHIPPED)
def test_a_plan_that_comes_with_us_is_right(name: str, tmp_path: Path) -> None:
    plan = shipped_plan(f"Albot/{name}", seed=7)
    assert plan.task in task_names()
    assert plan.seed == 7
    save_plan(plan, tmp_path / "config.yml")
    assert read_plan(tmp_path / "config.yml") == plan


def test_nested_settings_keep_their_defaults(tmp_path: Path) -> None:
    file = plan_file(tmp_path / "a.yml", env={"config": {"observations": {"home_range": 50}}})
    config = stage_settings(read_plan(file), StagePlan())["config"]
    assert config.observations.home_range == 50.0
    assert "way" in config.observations.parts  # As the task has it, not as an ObservationConfig.
    assert config.outing.longest == 2.0


def test_a_setting_is_told_where_it_stands_in_a_stage_or_for_all(tmp_path: Path) -> None:
    """A stage that has settings of its own may meet a fault of the settings of all stages."""
    for env, own, place in (
        ({"laser": "nope"}, {}, r"line \d+, env.laser: expected"),
        ({}, {"laser": "nope"}, r"curriculum\[0\].env.laser: expected"),
    ):
        plan = {"curriculum": [{"env": {"odometer": "ideal", **own}}]}
        file = plan_file(tmp_path / "a.yml", env=env, **plan)
        with pytest.raises(InputError, match=place) as error:
            read_plan(file)
        assert ("curriculum" in str(error.value)) == bool(own)


def test_seeds_of_evaluations_are_a_range_or_one_number(tmp_path: Path) -> None:
    for seeds in ("900..963", "901", 901):
        plan = read_plan(plan_file(tmp_path / "a.yml", evaluation={"seeds": seeds}))
        assert plan.evaluation is not None
        assert plan.evaluation.seeds == seeds
        save_plan(plan, tmp_path / "b.yml")
        assert read_plan(tmp_path / "b.yml") == plan


def test_worlds_are_dealt_out(tmp_path: Path) -> None:
    worlds = ["square-loop", "random:office:0..9"]
    plan = read_plan(plan_file(tmp_path / "a.yml", n_envs=4, env={"world": worlds}))
    assert stage_settings(plan, plan.stages[0])["world"] == worlds * 2
    plan = dataclasses.replace(plan, n_envs=3, batch_size=24)
    assert stage_settings(plan, plan.stages[0])["world"] == [*worlds, worlds[0]]
    plan = dataclasses.replace(plan, n_envs=1, batch_size=8)
    with pytest.raises(InputError, match=r"env.world: expected .* at most n_envs, 1, found 2"):
        stage_settings(plan, plan.stages[0], Location("plan").at("env"))


def test_evaluations_are_as_the_curriculum_ends(tmp_path: Path) -> None:
    plan = read_plan(
        plan_file(
            tmp_path / "a.yml",
            curriculum=[{"for_steps": 9}, {"env": {"odometer": "poor", "mapper": "odometry"}}],
            evaluation={"env": {"odometer": "ideal"}},
        )
    )
    settings = evaluation_settings(plan)
    assert (settings["odometer"], settings["mapper"]) == ("ideal", "odometry")
    assert "world" not in settings


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"algoritm": "ppo"}, r"line \d+, algoritm: .*did you mean algorithm"),
        ({"algorithm": "ppa"}, r"line \d+, algorithm: expected one of ppo.*did you mean ppo"),
        ({"task": "Albot/Homin-v0"}, r"line \d+, task: .*did you mean Albot/Homing-v0"),
        ({"n_envs": "many"}, r"line \d+, n_envs: expected a whole number, found many"),
        ({"n_envs": 0}, "n_envs: expected a whole number from 1 to 100000, found 0"),
        ({"batch_size": 7}, r"batch_size: expected a divisor of n_envs × n_steps, 16, found 7"),
        ({"learning_rate": "cos_3"}, "learning_rate: expected a number from 0, lin_A or lin_A_B"),
        ({"learning_rate": "lin_x"}, "learning_rate: expected a number from 0, lin_A"),
        ({"policy": {"activation": "tan"}}, "policy.activation: .*did you mean tanh"),
        ({"policy": {"net_arch": [0]}}, "policy.net_arch: expected at most 8 sizes from 1"),
        ({"policy": {"net_arch": 64}}, "policy.net_arch: expected a list, found 64"),
        ({"env": {"maper": "none"}}, "env.maper: expected one of .*did you mean mapper"),
        ({"env": {"config": {"radus": 2}}}, "env.config.radus: .*did you mean radius"),
        ({"env": {"config": {"radius": -1}}}, "env.config.radius: expected a positive number"),
        ({"env": {"movables": 1}}, "env.movables: expected true or false, found 1"),
        (
            {"env": {"observation": "rows"}},
            r"line \d+, env.observation: expected flat or dict, found rows",
        ),
        (
            {"curriculum": [{"env": {"observation": "rows"}}]},
            r"line \d+, curriculum\[0\].env.observation: expected flat or dict, found rows",
        ),
        (
            {"evaluation": {"env": {"observation": "rows"}}},
            r"line \d+, evaluation.env.observation: expected flat or dict, found rows",
        ),
        ({"evaluation": {"seeds": "9..3"}}, "evaluation.seeds: expected a range"),
        (
            {"evaluation": {"seeds": -1}},
            "evaluation.seeds: expected A..B, .* or one seed, found -1",
        ),
        ({"evaluation": {"env": {"x": 1}}}, "evaluation.env.x: expected one of"),
        ({"curriculum": [{"until": 3}]}, r"curriculum\[0\].until: expected one of"),
        ({"curriculum": [{}, {}]}, "curriculum: expected for_steps or until_success"),
        ({"curriculum": [{"env": {"mapper": 3}}]}, r"curriculum\[0\].env.mapper: expected text"),
        ({"batch_size": 1}, "batch_size: expected a whole number from 2"),
        ({"target_kl": 0}, "target_kl: expected a positive number"),
        ({"vf_coef": float("inf")}, "vf_coef: expected a number from 0"),
        ({"vf_coef": -1}, "vf_coef: expected a number from 0"),
        ({"learning_rate": "lin_0.1_2"}, "learning_rate: expected at most 1, found lin_0.1_2"),
        ({"n_envs": 100_001}, "n_envs: expected a whole number from 1 to 100000"),
        (
            {"n_envs": 1000, "n_steps": 10_001, "batch_size": 1000},
            "n_steps: expected at most 10,000,000 samples, .* found 10,001,000",
        ),
        (
            {"evaluation": {"env": {"world": "square-loop"}}},
            r"line \d+, evaluation.env.world: expected worlds in evaluation.worlds alone",
        ),
        (
            {"evaluation": {"worlds": ["square-loop", "nope.yaml"]}},
            r"line \d+, evaluation.worlds\[1\]: expected a file that exists, found 'nope.yaml'",
        ),
        (
            {"evaluation": {"worlds": ["random:ofice"]}},
            r"line \d+, evaluation.worlds\[0\]: expected one of the kinds .*did you mean office",
        ),
        ({"policy": {"log_std_init": float("nan")}}, "policy.log_std_init: expected a number"),
        ({"policy": {"initial_action": [0, float("nan")]}}, "initial_action: expected finite"),
        ({"env": {"world": "nope"}}, r"line \d+, env.world: expected a file, random"),
        ({"env": {"world": ["square-loop", "nope"]}}, r"line \d+, env.world: .*found nope"),
        (
            {"env": {"world": "random:office:1?rooms=1"}},
            r"line \d+, env.world, random:office, rooms: expected a whole number from 2",
        ),
        (
            {"env": {"world": "random:ofice:1"}},
            "env.world, random world: expected one of the kinds .*did you mean office",
        ),
        (
            {"env": {"world": ["square-loop"] * 3}},
            r"line \d+, env.world: expected at least one world, and at most n_envs, 2, found 3",
        ),
        ({"env": {"world": []}}, r"line \d+, env.world: expected at least one world, .* found 0"),
        (
            {"curriculum": [{"env": {"world": ["square-loop"] * 3}}]},
            r"line \d+, curriculum\[0\].env.world: expected at least one world, .* found 3",
        ),
        ({"env": {"mapper": "nope"}}, r"line \d+, env.mapper: expected none or one of albot0"),
        ({"env": {"threads": 0}}, r"line \d+, env.threads: expected a whole number from 1"),
        (
            {"env": {"max_episode_steps": 0}},
            "env.max_episode_steps: expected a whole",
        ),
        ({"curriculum": [{"env": {"odometer": "x"}}]}, r"curriculum\[0\].env.odometer: expected"),
        ({"device": "tpu"}, "device: expected one of auto, cpu, cuda"),
        (
            {"policy": {"initial_action": [1]}},
            r"line \d+, policy.initial_action: expected 3 numbers, found 1",
        ),
        (
            {"policy": {"kind": "candidates"}},
            r"line \d+, policy.kind: expected mlp, or .* arrivals, found candidates and laser",
        ),
        (
            {"policy": {"sampled": True, "initial_action": None}, "env": {"action": "discrete"}},
            r"line \d+, policy.sampled: expected false for discrete actions, found true",
        ),
        ({"policy": {"net_arch": [8] * 9}}, "policy.net_arch: expected at most 8 sizes"),
        ({"policy": {"net_arch": [100_000]}}, "policy.net_arch: .* from 1 to 65536"),
        ({"policy": {"log_std_init": 1000}}, "policy.log_std_init: expected a number from -20 to"),
        ({"policy": {"lstm_layers": 9}}, "policy.lstm_layers: expected a whole number from 1 to 8"),
        ({"seed": -1}, r"line \d+, seed: expected a whole number from 0 to 4294967295, found -1"),
        ({"seed": 2**32}, r"line \d+, seed: .* from 0 to 4294967295, found 4294967296"),
        ({"seed": 2**63 - 1}, r"seed: .* from 0 to 4294967295, found 9223372036854775807"),
        (
            {"seed": 2**63},
            r"line \d+, seed: expected an integer within ±9223372036854775807, "
            "found 9223372036854775808",
        ),
        ({"torch_threads": 10**12}, "torch_threads: expected a whole number from 0 to 1024"),
        (
            {"curriculum": [{"for_steps": 9}, {"env": {"action": "discrete"}}]},
            r"curriculum\[1\].env: expected the same actions as before, Box.*, found Discrete",
        ),
        (
            {"evaluation": {"env": {"laser": "none"}}},
            "evaluation.env: expected the same observations as before, Box",
        ),
    ],
)
def test_what_is_wrong_is_said_where_it_stands(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_plan(plan_file(tmp_path / "plan.yml", **changes))
    assert "\n" not in str(caught.value)


def test_a_gpu_that_is_not_there_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    with pytest.raises(InputError, match=r"plan.yml, line \d+, device: expected auto or cpu"):
        read_plan(plan_file(tmp_path / "plan.yml", device="cuda"))
    monkeypatch.setattr("torch.cuda.is_available", lambda: True)
    assert read_plan(plan_file(tmp_path / "plan.yml", device="cuda")).device == "cuda"


def test_what_is_replaced_must_be_valid_too(tmp_path: Path) -> None:
    assert read_plan(plan_file(tmp_path / "plan.yml"), n_timesteps=7).n_timesteps == 7
    file = plan_file(tmp_path / "plan.yml", n_timesteps=float("nan"))
    with pytest.raises(InputError, match=r"line \d+, n_timesteps: expected a whole number"):
        read_plan(file, n_timesteps=7)


def test_a_plan_is_for_its_task(tmp_path: Path) -> None:
    file = plan_file(tmp_path / "plan.yml")
    assert read_plan(file, TASK).task == TASK
    with pytest.raises(InputError, match=r"line \d+, task: expected Albot/Explore-v0, found"):
        read_plan(file, "Albot/Explore-v0")
    file.write_text("- 1\n")
    with pytest.raises(InputError, match="expected a mapping"):
        read_plan(file, TASK)


def test_schedules_go_evenly_from_one_value_to_another() -> None:
    fall, rise, still = (parse_schedule(text, "x") for text in ("lin_4", "lin_1_3", 0.5))
    assert [fall(left) for left in (1.0, 0.25, 0.0)] == [4.0, 1.0, 0.0]
    assert [rise(left) for left in (1.0, 0.5, 0.0)] == [1.0, 2.0, 3.0]
    assert still(1.0) == still(0.0) == 0.5


def test_the_plan_of_nothing_is_whole() -> None:
    plan = TrainingPlan()
    assert plan.stages == (StagePlan(),)
    assert plan.n_envs * plan.n_steps % plan.batch_size == 0


def test_the_plan_in_the_documents_is_one(tmp_path: Path) -> None:
    text = (Path(__file__).parents[3] / "docs" / "training.md").read_text(encoding="utf-8")
    example = text.split("```yaml\n")[1].split("```")[0]
    (tmp_path / "plan.yml").write_text(example, encoding="utf-8")
    plan = read_plan(tmp_path / "plan.yml")
    assert len(plan.stages) == 2
    assert plan.env["config"]["observations"]["laser_sectors"] == 36
