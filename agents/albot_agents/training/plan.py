"""The plan of a training run: the content of its YAML file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from operator import attrgetter
from typing import Any

from albot_agents.evaluation.plan import parse_seeds
from albot_agents.trained.encoders import LAYERS, SIZES
from albot_agents.training.claims_plan import ClaimsPlan
from albot_agents.training.off_policy_plan import OFF_POLICY, USERS, VALUE_BASED, OffPolicyPlan
from albot_agents.training.pretrain_plan import PretrainPlan
from albot_agents.training.sweep_plan import SweepPlan
from albot_core.errors import InputError, did_you_mean
from albot_core.ranges import FINITE, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

ON_POLICY = ("ppo", "recurrent_ppo")
"""Proximal policy optimisation (Schulman et al., arXiv:1707.06347), without and with an LSTM."""
ALGORITHMS = (*ON_POLICY, *OFF_POLICY)
POLICIES = ("mlp", "cnn", "attention", "multi_input", "planner", "candidates")
"""Networks that take the whole observation, that see patches by convolutions, the graph of places
by attention, or both, that plan over the patch of the map, and networks that take each candidate in
the observation separately."""
ACTIVATIONS = ("elu", "relu", "tanh")
DEVICES = ("auto", "cpu", "cuda")

_COUNT = Range("a whole number from 1", 1.0, whole=True)
_ENVIRONMENTS = Range("a whole number from 1 to 100000", 1.0, 1e5, whole=True)
MOST_SAMPLES = 10_000_000
"""Largest number of samples between two updates: they are held in memory."""
LARGEST_SEED = 2**32 - 1
"""Largest seed: stable-baselines3 seeds numpy's old generator too, which takes 32 bits."""
_SEED = Range(f"a whole number from 0 to {LARGEST_SEED}", 0.0, float(LARGEST_SEED), whole=True)
_HEADS = Range("a whole number from 1 to 64", 1.0, 64.0, whole=True)
_LSTM_LAYERS = Range("a whole number from 1 to 8", 1.0, LAYERS.most, whole=True)
_COST = Range("a number from 0.001 to 1000", 0.001, 1000.0)
_LOG_STD = Range("a number from -20 to 2", -20.0, 2.0)  # As stable-baselines3's SAC has it.
_THREADS = Range("a whole number from 0 to 1024", 0.0, 1024.0, whole=True)
_FROM_TWO = Range("a whole number from 2, for a standard deviation", 2.0, whole=True)
_USERS = {
    **dict.fromkeys(
        ("n_steps", "n_epochs", "gae_lambda", "clip_range", "ent_coef", "vf_coef", "target_kl"),
        ON_POLICY,
    ),
    "max_grad_norm": (*ON_POLICY, *VALUE_BASED),
    "policy.value_arch": (*ON_POLICY, "sac"),
    "policy.log_std_init": (*ON_POLICY, "sac"),
    **dict.fromkeys(("policy.sampled", "policy.sampled_statements"), ON_POLICY),
    **dict.fromkeys(("policy.lstm_size", "policy.lstm_layers"), ("recurrent_ppo",)),
    **{f"off_policy.{name}": users for name, users in USERS.items()},
}
"""The algorithms that use each field; those that are not here are used by all."""
_KIND_USERS = {
    "policy.filters": ("cnn", "multi_input"),
    **dict.fromkeys(("policy.planner_radius", "policy.planner_costs"), ("planner",)),
    **dict.fromkeys(("policy.graph_units", "policy.graph_heads"), ("attention", "multi_input")),
}
"""The kinds of policies that use each field, for fields that not all kinds use."""


@dataclass(frozen=True, kw_only=True)
class PolicyPlan:
    """The networks. Policy and value have one each; with PPO they share the encoders of `kind`."""

    kind: str = "mlp"
    """What encodes the observation before the LSTM or the first hidden layer:

    - `mlp`: nothing,
    - `cnn`: convolutions encode each observed patch (`map_patch`, `true_patch`, `coverage`),
    - `attention`: attention pools the rows of `place_graph`,
    - `multi_input`: both,
    - `planner`: the cheapest ways home over the cells of `map_patch`, whose costs are learnt,
    - `candidates`: for tasks whose action selects one of several candidates or none. The networks
      process each candidate separately, and pool by the maximum over all of them.

    The parts that nothing encodes enter as they are."""
    filters: tuple[int, ...] = (8, 16, 16)
    """Number of 3 × 3 filters with stride 2 of each layer of convolutions."""
    graph_units: int = 32
    """Length of an embedded row of the graph of places."""
    graph_heads: int = 4
    """Number of heads of the attention, each of which pools the rows by its own weights."""
    planner_radius: int = 3
    """Distance from the robot of the cells by which a planner compares the ways (cells)."""
    planner_costs: tuple[float, ...] | None = None
    """What a planner's cells cost at first where they show a channel of `map_patch`, one number a
    channel, as a factor of the cost of an unknown cell; None for 1 each. With walls that cost no
    more than ground, a way leads through them, and few samples say that it does not."""
    net_arch: tuple[int, ...] = (64, 64)
    """Units of each hidden layer."""
    value_arch: tuple[int, ...] | None = None
    """Units of each hidden layer of the value network, for `sac` of each critic; None for the same
    as `net_arch`."""
    activation: str = "tanh"
    """`tanh`, `relu` or `elu`."""
    log_std_init: float = 0.0
    """Initial logarithm of the actions' standard deviation."""
    initial_action: tuple[float, ...] | None = None
    """Mean action of the initial policy; None for 0. For discrete actions, their initial logits,
    for `dqn` and `qrdqn` the logits of the random actions by which they explore; for candidates,
    the initial logits of "none" and of "this one". It can keep an untrained policy from declaring
    home by chance after a few steps, before it could learn to drive."""
    sampled: bool = False
    """Whether the agent samples its actions, as in training, instead of taking the mean action,
    which may stand still forever between turning left and right. Evaluations during training use
    the mean anyway. Not for discrete actions."""
    sampled_statements: bool = True
    """Whether a sampled agent also samples what it says, such as that it is home, or decides it by
    the mean. A small chance at each of a thousand steps is a large one; but a network that learnt
    to say something now and then may never do so in the mean."""
    lstm_size: int = 128
    """Units of each LSTM layer, for `recurrent_ppo` only."""
    lstm_layers: int = 1
    """Number of LSTM layers before the hidden layers, for `recurrent_ppo` only."""

    def __post_init__(self) -> None:
        check_fields(self, SIZES, "lstm_size", "graph_units", "planner_radius")
        check_fields(self, _HEADS, "graph_heads")
        check_fields(self, _LSTM_LAYERS, "lstm_layers")
        check_fields(self, _LOG_STD, "log_std_init")
        if any(number not in FINITE for number in self.initial_action or ()):
            found = str(list(self.initial_action or ()))
            raise InputError("PolicyPlan.initial_action", "finite numbers", found)
        if any(cost not in _COST for cost in self.planner_costs or ()):
            found = str(list(self.planner_costs or ()))
            raise InputError("PolicyPlan.planner_costs", f"{_COST.expected}, each", found)
        for name in ("net_arch", "value_arch", "filters"):
            sizes = getattr(self, name) or ()
            if len(sizes) not in LAYERS or any(units not in SIZES for units in sizes):
                expected = "at most 8 sizes from 1 to 65536"
                raise InputError(f"PolicyPlan.{name}", expected, str(list(sizes)))
        _check_name("PolicyPlan.kind", self.kind, POLICIES)
        _check_name("PolicyPlan.activation", self.activation, ACTIVATIONS)


@dataclass(frozen=True, kw_only=True)
class EvaluationPlan:
    """Evaluations of the policy during training, always in the same episodes."""

    worlds: tuple[str, ...] = ("random:office",)
    """World specs as for `albot evaluate`; for `random:KIND` each seed is a world of its own."""
    seeds: str | int = "900..963"
    """`A..B`, both included, or one seed; each world with each seed is one episode."""
    every: int = 1_000_000
    """Samples between two evaluations."""
    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment that differ from training."""
    deterministic: bool = True
    """Whether the mean action is taken also with `policy.sampled`; false for the actions that the
    agent will take."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "every")
        if not self.worlds:
            raise InputError("EvaluationPlan.worlds", "one world or more", "none")
        try:
            parse_seeds(str(self.seeds))
        except InputError as error:
            raise InputError("EvaluationPlan.seeds", error.expected, error.found) from None


@dataclass(frozen=True, kw_only=True)
class StagePlan:
    """A stage of a curriculum. It ends when one of its conditions holds; the last never ends."""

    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment that differ from those of the plan."""
    for_steps: int | None = None
    """Samples after which the next stage begins."""
    until_success: float | None = None
    """Success rate over the 500 episodes of the stage that ended last, at which the next stage
    begins."""

    def __post_init__(self) -> None:
        if self.for_steps is not None:
            check_fields(self, _COUNT, "for_steps")
        if self.until_success is not None:
            check_fields(self, SHARE, "until_success")


@dataclass(frozen=True, kw_only=True)
class TrainingPlan:
    """A training run. Names follow rl-zoo3 and stable-baselines3 where these have one."""

    task: str = ""
    """Id of the environment."""
    algorithm: str = "ppo"
    """`ppo`, `recurrent_ppo` or, for continuous actions, `sac`; for discrete ones `dqn` or `qrdqn`.
    A field that the algorithm does not use must keep its default."""
    n_timesteps: int = 10_000_000
    """Total number of samples."""
    n_envs: int = 1024
    """Number of environments that are stepped together, 100,000 at most."""
    policy: PolicyPlan = field(default_factory=PolicyPlan)
    """The networks."""
    n_steps: int = 32
    """Steps per environment between two updates; 10 million samples at most of all together. For
    `ppo` and `recurrent_ppo`."""
    batch_size: int = 8192
    """Samples per gradient step; for `ppo` and `recurrent_ppo` a divisor of n_envs × n_steps."""
    n_epochs: int = 4
    """Number of times that each sample is used; for `ppo` and `recurrent_ppo`."""
    learning_rate: float | str = "lin_0.0003"
    """Learning rate of Adam, 1 at most; a number or a schedule."""
    gamma: float = 0.995
    """Discount factor per step."""
    gae_lambda: float = 0.95
    """λ of generalised advantage estimation (Schulman et al., arXiv:1506.02438); for `ppo` and
    `recurrent_ppo`."""
    clip_range: float | str = 0.2
    """ε of PPO's clipping, for `ppo` and `recurrent_ppo`; a number or a schedule."""
    ent_coef: float | str = 0.0
    """Coefficient of the entropy in the loss, for `ppo` and `recurrent_ppo`; a number or a
    schedule. That of `sac` is `off_policy.ent_coef`."""
    vf_coef: float = 0.5
    """Coefficient of the value error in the loss; for `ppo` and `recurrent_ppo`."""
    max_grad_norm: float = 0.5
    """Largest norm of a gradient; longer ones are clipped. Not for `sac`."""
    target_kl: float | None = None
    """KL divergence from the policy that collected the samples, above which an update ends; None
    for no limit. For `ppo` and `recurrent_ppo`."""
    off_policy: OffPolicyPlan = field(default_factory=OffPolicyPlan)
    """What `sac`, `dqn` and `qrdqn` have in place of the fields for `ppo`."""
    env: Mapping[str, Any] = field(default_factory=dict)
    """Settings of the environment, including `config`. A list of worlds, `n_envs` at most, is
    distributed over the environments in turn."""
    evaluation: EvaluationPlan | None = field(default_factory=EvaluationPlan)
    """Evaluations during training; None for no evaluations."""
    curriculum: tuple[StagePlan, ...] = ()
    """The stages in order; empty for a single stage without end."""
    pretrain: PretrainPlan | None = None
    """Behaviour cloning of an agent before the first sample; None to begin untrained."""
    claims: ClaimsPlan | None = None
    """Claims by a classifier of their own, learnt after the last sample; None for those that the
    policy has learnt."""
    sweep: SweepPlan | None = None
    """A search for the best values of some fields; None for a single training."""
    checkpoint_every: int = 500_000
    """Samples between two checkpoints."""
    seed: int = 0
    """Seed of all randomness: worlds, episodes, initial weights. A whole number from 0 to
    2³² − 1."""
    device: str = "auto"
    """`cpu`, `cuda`, or `auto`: the GPU if there is one and the networks are large enough to profit
    from it."""
    torch_threads: int = 1
    """Threads of the learner; 0 for one per processor. Two threads that share their processors with
    another process wait for each other, ten times longer than one thread needs for the work."""

    def __post_init__(self) -> None:
        check_fields(self, _COUNT, "n_timesteps", "n_steps", "n_epochs", "checkpoint_every")
        check_fields(self, _ENVIRONMENTS, "n_envs")
        check_fields(self, _FROM_TWO, "batch_size")
        check_fields(self, NOT_NEGATIVE, "vf_coef")
        if self.target_kl is not None:
            check_fields(self, POSITIVE, "target_kl")
        check_fields(self, _SEED, "seed")
        check_fields(self, _THREADS, "torch_threads")
        check_fields(self, SHARE, "gamma", "gae_lambda")
        check_fields(self, POSITIVE, "max_grad_norm")
        _check_name("TrainingPlan.algorithm", self.algorithm, ALGORITHMS)
        _check_name("TrainingPlan.device", self.device, DEVICES)
        if self.recurrent and self.policy.kind == "candidates":
            expected = "another kind than candidates for an LSTM"
            raise InputError("TrainingPlan.policy", expected, self.policy.kind)
        if self.pretrain is not None and self.learns_off_policy:
            expected = f"null for {self.algorithm}: only {' and '.join(ON_POLICY)} clone"
            raise InputError("TrainingPlan.pretrain", expected, "a pretraining")
        if self.claims is not None:
            self._check_claims()
        for name in ("learning_rate", "clip_range", "ent_coef"):
            self.schedule(name)
        rate = self.schedule("learning_rate")
        if max(rate.first, rate.last) > 1:
            raise InputError("TrainingPlan.learning_rate", "at most 1", str(self.learning_rate))
        if self.learns_off_policy:
            self._check_off_policy()
        else:
            self._check_rollout()
        if self.sweep is not None:
            self._check_sweep(self.sweep)
        if any(stage.for_steps is stage.until_success is None for stage in self.curriculum[:-1]):
            expected = "for_steps or until_success in all stages but the last"
            raise InputError("TrainingPlan.curriculum", expected, "a stage with neither")

    def check_unused_fields(self) -> None:
        """Check that no field is set of which algorithm and kind of policy make no use.

        Its user would be left in the belief that it matters. Plans that runs and agents have saved
        are not checked: they hold the defaults of the version that wrote them.

        Raises:
            InputError: One is; the message names all of them.
        """
        defaults = {"policy": PolicyPlan(), "off_policy": OffPolicyPlan()}
        tops = {each.name: each.default for each in fields(self)}
        found = []
        for chosen, table in ((self.algorithm, _USERS), (self.policy.kind, _KIND_USERS)):
            for path, users in table.items():
                top, _, name = path.partition(".")
                default = getattr(defaults[top], name) if name else tops[top]
                value = attrgetter(path)(self)
                if chosen not in users and value != default:
                    found.append((path, value, default, chosen))
        if not found:
            return
        (path, value, default, chosen), *others = found
        top, _, name = path.partition(".")
        wanted = f"{name} {'null' if default is None else default}".lstrip()
        expected = f"{wanted}, the default, because {chosen} does not use it"
        more = f" (and also {', '.join(other for other, *_ in others)})" if others else ""
        raise InputError(f"TrainingPlan.{top}", expected, f"{value}{more}")

    def _check_claims(self) -> None:
        """Raise InputError if no classifier fits beside the policy's network."""
        policy = self.policy
        fitting = "hidden layers, and without candidates, LSTM and noise in what is said"
        found = [
            *([] if self.algorithm == "ppo" else [self.algorithm]),
            *(["the kind candidates"] if policy.kind == "candidates" else []),
            *([] if policy.net_arch else ["no layer in net_arch"]),
            *(["sampled_statements"] if policy.sampled and policy.sampled_statements else []),
        ]
        if found:
            expected = f"null, or a policy of ppo with {fitting}"
            raise InputError("TrainingPlan.claims", expected, " and ".join(found))

    def _check_sweep(self, sweep: SweepPlan) -> None:
        """Raise InputError if no evaluation can tell which trial is the best."""
        if self.evaluation is None:
            raise InputError("TrainingPlan.sweep", "null without evaluations", "a search")
        if sweep.grace is not None and sweep.grace > self.n_timesteps:
            expected = f"a grace of at most n_timesteps, {self.n_timesteps}"
            raise InputError("TrainingPlan.sweep", expected, str(sweep.grace))

    def _check_rollout(self) -> None:
        """Raise InputError unless the samples between two updates fit memory and batches."""
        samples = self.n_envs * self.n_steps
        if samples > MOST_SAMPLES:
            expected = f"at most {MOST_SAMPLES:,} samples, n_envs × n_steps, between two updates"
            raise InputError("TrainingPlan.n_steps", expected, f"{samples:,}")
        if samples % self.batch_size:
            expected = f"a divisor of n_envs × n_steps, {samples}"
            raise InputError("TrainingPlan.batch_size", expected, str(self.batch_size))

    def _check_off_policy(self) -> None:
        """Raise InputError for what does not fit an algorithm that learns from a replay buffer."""
        place, own, kind = "TrainingPlan.off_policy", self.off_policy, self.policy.kind
        if kind == "candidates":
            expected = f"another kind than candidates for {self.algorithm}"
            raise InputError("TrainingPlan.policy", expected, kind)
        if own.buffer_size < self.n_envs:
            expected = f"a buffer_size of n_envs, {self.n_envs}, or more"
            raise InputError(place, expected, str(own.buffer_size))
        if own.learning_starts >= self.n_timesteps:
            expected = (
                f"learning_starts below n_timesteps, {self.n_timesteps}, or nothing is learnt"
            )
            raise InputError(place, expected, str(own.learning_starts))

    def schedule(self, name: str) -> Schedule:
        """Return the schedule of a field.

        Raises:
            InputError: The field's value is not a schedule.
        """
        return parse_schedule(getattr(self, name), f"TrainingPlan.{name}")

    @property
    def recurrent(self) -> bool:
        """Whether the policy has an LSTM."""
        return self.algorithm == "recurrent_ppo"

    @property
    def learns_off_policy(self) -> bool:
        """Whether the algorithm learns from a replay buffer."""
        return self.algorithm in OFF_POLICY

    @property
    def stages(self) -> tuple[StagePlan, ...]:
        """The stages; at least one."""
        return self.curriculum or (StagePlan(),)


def _check_name(place: str, name: str, names: tuple[str, ...]) -> None:
    if name not in names:
        raise InputError(place, f"one of {', '.join(names)}", f"{name}{did_you_mean(name, names)}")


_LINEAR = re.compile(r"lin_([^_]+)(?:_([^_]+))?")


@dataclass(frozen=True)
class Schedule:
    """A number that changes linearly from one value to another."""

    first: float
    """Value at the beginning of the training."""
    last: float
    """Value at the end of the training."""

    def __call__(self, remaining: float | int) -> float:
        """Return the value when the share `remaining` of the training is still ahead."""
        return self.last + (self.first - self.last) * remaining


def parse_schedule(value: Any, name: str) -> Schedule:
    """Parse a schedule: a number (constant), `lin_A` (from A to 0), or `lin_A_B` (from A to B).

    Args:
        value: The number or text.
        name: Name of the field, for the error.

    Raises:
        InputError: The value is something else, or has a negative or infinite number.
    """
    expected = "a number from 0, lin_A or lin_A_B"
    try:
        if isinstance(value, str):
            found = _LINEAR.fullmatch(value)
            if found is None:
                raise ValueError
            ends = float(found[1]), float(found[2] or 0)
        else:
            ends = value, value
    except ValueError:
        raise InputError(name, expected, str(value)) from None
    if any(end not in NOT_NEGATIVE for end in ends):
        raise InputError(name, expected, str(value))
    return Schedule(*ends)
