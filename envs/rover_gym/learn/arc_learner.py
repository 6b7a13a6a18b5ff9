"""What PyTorch and stable-baselines3 learn in `rover train`: the network, and PPO on a leash."""

import copy
from collections.abc import Sequence
from typing import Any

import gymnasium as gym
import numpy.typing as npt
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.policies import MultiInputActorCriticPolicy
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvObs, VecEnvStepReturn

from rover_gym.drive.arcs.arc_driver import SIZES, arc_space, observation_space
from rover_gym.drive.arcs.arc_network import CONVOLUTIONS, DENSE, ArcNetwork
from rover_gym.drive.scan.scan_policy import SCAN
from rover_gym.learn.arc_config import ArcPPOConfig, ImitationConfig
from rover_gym.learn.arc_rovers import STEPS, Labels, Rovers


class ArcExtractor(BaseFeaturesExtractor):
    """Convolutions over the scan, and a dense layer over what they find and the rest of the observation."""

    def __init__(self, space: gym.spaces.Dict) -> None:
        super().__init__(space, DENSE[0])
        parts: list[torch.nn.Module] = []
        channels = 1
        for outputs, kernel, stride in CONVOLUTIONS:
            parts += [torch.nn.Conv2d(channels, outputs, kernel, stride), torch.nn.ReLU()]
            channels = outputs
        self.convolutions = torch.nn.Sequential(*parts, torch.nn.Flatten())
        with torch.no_grad():
            found = self.convolutions(torch.zeros(1, 1, *SCAN[:2])).shape[1]
        self.dense = torch.nn.Linear(found + sum(SIZES.values()), DENSE[0])

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        """`(n, DENSE[0])` features."""
        found = self.convolutions(observations["scan"][:, None])
        together = torch.cat((found, *(observations[name] for name in SIZES)), dim=1)
        return torch.relu(self.dense(together))


class LeashedPolicy(MultiInputActorCriticPolicy):
    """An actor and critic whose "entropy" is minus the divergence from a reference, so that PPO's bonus is a leash."""

    #: The network that it must not leave, in a tuple, so that it is no part of this one.
    reference: tuple["LeashedPolicy", ...] = ()

    def evaluate_actions(
        self, obs: Any, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor | None]:
        """Values, logarithms of the actions' probabilities, and minus the divergence from the reference."""
        features = self.extract_features(obs)
        latent_pi, latent_vf = self.mlp_extractor(features)
        distribution: Any = self._get_action_dist_from_latent(latent_pi)
        log_prob = distribution.log_prob(actions)
        if not self.reference:
            return self.value_net(latent_vf), log_prob, distribution.entropy()
        with torch.no_grad():
            kept: Any = self.reference[0].get_distribution(obs)
        divergence = torch.distributions.kl_divergence(distribution.distribution, kept.distribution)
        return self.value_net(latent_vf), log_prob, -divergence

    def tie(self) -> None:
        """Makes the present network the reference."""
        self.reference = ()
        kept = copy.deepcopy(self)
        for parameter in kept.parameters():
            parameter.requires_grad_(False)
        self.reference = (kept,)

    def hold_actor(self, is_held: bool) -> None:
        """Whether only the critic learns: the features and the actor keep their weights."""
        for part in (self.features_extractor, self.mlp_extractor.policy_net, self.action_net):
            for parameter in part.parameters():
                parameter.requires_grad_(not is_held)


class ArcVecEnv(VecEnv):
    """The rovers of worker processes as stable-baselines3's vector."""

    def __init__(self, rovers: Rovers | None, n: int, scale: float = 1.0) -> None:
        self._rovers, self._scale = rovers, scale
        super().__init__(n, observation_space(), arc_space())

    def reset(self) -> VecEnvObs:
        """Starts the episodes."""
        assert self._rovers is not None  # noqa: S101 - only a vector with rovers drives
        return dict(self._rovers.begin())

    def step_async(self, actions: npt.NDArray[Any]) -> None:
        """Asks for a decision of each rover."""
        assert self._rovers is not None  # noqa: S101
        self._rovers.send(actions, self._scale)

    def step_wait(self) -> VecEnvStepReturn:
        """What came of it."""
        assert self._rovers is not None  # noqa: S101
        seen, rewards, dones, infos = self._rovers.receive()
        return dict(seen), rewards, dones, infos

    def close(self) -> None:
        """Does nothing: whoever made the rovers closes them."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """None where stable-baselines3 asks for the render mode: the rovers are elsewhere.

        Raises:
            AttributeError: Anything else is asked for.
        """
        if attr_name != "render_mode":
            raise AttributeError(attr_name)
        return [None for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuses, since worker processes have the rovers; stable-baselines3 demands the method, PPO never calls it.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"{attr_name}: rovers {indices} of worker processes cannot be given {value!r}")

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Refuses, as `set_attr` does.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(
            f"{method_name}: rovers {indices} of worker processes are not called with {args}, {kwargs}"
        )

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """True for a monitor, whose infos the workers give."""
        return [wrapper_class is Monitor for _ in self._get_indices(indices)]


def make_model(settings: ArcPPOConfig, venv: VecEnv, seed: int, device: str) -> PPO:
    """stable-baselines3's PPO with the network, untrained."""
    first, last = settings.learning_rate, settings.final_learning_rate
    return PPO(
        LeashedPolicy,
        venv,
        seed=seed,
        device=device,
        n_steps=settings.n_steps,
        batch_size=settings.batch_size,
        n_epochs=settings.n_epochs,
        learning_rate=lambda remaining: last + (first - last) * remaining,
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        vf_coef=settings.vf_coef,
        ent_coef=settings.leash,
        policy_kwargs={
            "features_extractor_class": ArcExtractor,
            "net_arch": {"pi": list(DENSE[1:]), "vf": list(DENSE[1:])},
            "activation_fn": torch.nn.ReLU,
        },
    )


def _actor(policy: Any) -> dict[str, torch.Tensor]:
    """The actor's weights and biases, by their names in an `ArcNetwork`."""
    extractor = policy.features_extractor
    convolutions = [layer for layer in extractor.convolutions if isinstance(layer, torch.nn.Conv2d)]
    dense = [extractor.dense, *(x for x in policy.mlp_extractor.policy_net if isinstance(x, torch.nn.Linear))]
    dense.append(policy.action_net)
    found: dict[str, torch.Tensor] = {}
    for kind, layers in (("conv", convolutions), ("dense", dense)):
        for i, layer in enumerate(layers):
            found[f"{kind}_{i}"], found[f"{kind}_bias_{i}"] = layer.weight, layer.bias
    return found


def network_of(policy: Any) -> ArcNetwork:
    """The actor as a network that needs NumPy alone."""
    return ArcNetwork({name: values.detach().cpu().numpy().copy() for name, values in _actor(policy).items()})


def begin_with(policy: Any, network: ArcNetwork) -> None:
    """Gives the actor a network's weights."""
    with torch.no_grad():
        for name, values in _actor(policy).items():
            values.copy_(torch.from_numpy(network.arrays[name].copy()))


def imitate(policy: Any, rounds: Sequence[Labels], settings: ImitationConfig, seed: int) -> tuple[float, float]:
    """Fits the actor to all labels by cross-entropy.

    Returns:
        The loss over the last pass, and the share of labels that were the most probable arc.
    """
    device = policy.device
    data = {
        name: torch.cat([torch.from_numpy(part[name]) for part in rounds]).to(device)
        for name in ("scan", *SIZES, "label")
    }
    n, size = len(data["label"]), min(settings.batch_size, len(data["label"]))
    torch.manual_seed(seed)
    optimiser = torch.optim.AdamW(policy.parameters(), settings.learning_rate, weight_decay=1e-4)
    total = settings.epochs * (n // size)
    rate = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda k: min(1.0, (k + 1) / 50) * (1.0 - 0.9 * k / total))
    losses: list[torch.Tensor] = []
    hits: list[torch.Tensor] = []
    policy.set_training_mode(True)
    for epoch in range(settings.epochs):
        order = torch.randperm(n, device=device)
        for k in range(n // size):
            part = order[k * size : (k + 1) * size]
            observed = {name: data[name][part] for name in SIZES}
            observed["scan"] = data["scan"][part].float() / STEPS
            label = data["label"][part].long()
            logits = policy.get_distribution(observed).distribution.logits
            loss = torch.nn.functional.cross_entropy(logits, label)
            optimiser.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(policy.parameters(), 1.0)
            optimiser.step()
            rate.step()
            if epoch == settings.epochs - 1:
                losses.append(loss.detach())
                hits.append((logits.argmax(dim=1) == label).float().mean())
    policy.set_training_mode(False)
    return float(torch.stack(losses).mean()), float(torch.stack(hits).mean())


def chosen_device(device: str) -> str:
    """The device of a name; "auto" is a graphics card where there is one."""
    if device == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    return device


def leash_at(settings: ArcPPOConfig, passed: float) -> float:
    """Weight of the divergence where a share of the training has passed."""
    ratio = settings.final_leash / max(settings.leash, 1e-12)
    return float(settings.leash * ratio ** min(1.0, max(0.0, passed)))
