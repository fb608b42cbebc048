"""Shapes, bounds, exact zeros, determinism, sizes, key points and gradients of the networks."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from samrl_core.common.errors import InputError
from samrl_core.policy.networks.networks import (
    FEATURES,
    ResidualActor,
    SensingQ,
    SimActor,
    TwinCritic,
    bound_length,
    drop_features,
    key_points,
)

LIMIT = 0.01
MAKE = {
    "sim_actor": lambda g: SimActor(LIMIT, g),
    "sensing_q": lambda g: SensingQ(g),
    "residual_actor": lambda g: ResidualActor(LIMIT, g),
    "twin_critic": lambda g: TwinCritic(LIMIT, g),
}


def generator(seed: int = 1) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def inputs(name: str, batch: int = 3, size: int = 32) -> list[torch.Tensor]:
    g = generator(7)
    image = torch.randn((batch, 6, size, size), generator=g)
    image[:, 3:, : size // 4] = 0.0  # nothing seen there
    actions = {"sim_actor": 0, "sensing_q": 1, "residual_actor": 1, "twin_critic": 2}[name]
    if name == "twin_critic":
        image = torch.rand((batch, FEATURES), generator=g)
    return [image, *(LIMIT * torch.randn((batch, 3), generator=g) for _ in range(actions))]


@pytest.mark.parametrize("name", MAKE)
def test_same_seed_same_network_and_small_enough(name: str) -> None:
    state = torch.get_rng_state()
    first, again, other = MAKE[name](generator()), MAKE[name](generator()), MAKE[name](generator(2))
    assert torch.equal(torch.get_rng_state(), state)  # torch's own generator is left alone
    x = inputs(name)
    for a, b in zip(first.parameters(), again.parameters(), strict=True):
        assert torch.equal(a, b)
    assert any(not torch.equal(a, b) for a, b in zip(first.parameters(), other.parameters(), strict=True))
    assert sum(p.numel() for p in first.parameters()) < 750_000
    for out in _outputs(first, x):
        assert bool(torch.isfinite(out).all())


def _outputs(network: nn.Module, x: list[torch.Tensor]) -> tuple[torch.Tensor, ...]:
    out = network(*x)
    return out if isinstance(out, tuple) else (out,)


@pytest.mark.parametrize("name", MAKE)
def test_every_weight_and_input_gets_a_gradient(name: str) -> None:
    network = MAKE[name](generator())
    if name == "residual_actor":
        nn.init.normal_(network.head[-1].weight, generator=generator(5))
    x = [v.requires_grad_() for v in inputs(name, batch=8)]
    torch.cat([v.ravel() for v in _outputs(network, x)]).sum().backward()
    for label, parameter in network.named_parameters():
        if not parameter.requires_grad:  # the residual's encoder
            continue
        # A shift of all logits of a map alike does nothing to its softmax.
        if label.split(".")[1] in ("fine", "coarse", "context") and label.endswith("bias"):
            continue
        assert parameter.grad is not None and bool((parameter.grad != 0).any()), label
    for k, value in enumerate(x):
        assert bool(torch.isfinite(value.grad).all()) and bool((value.grad != 0).any()), k


def test_actions_are_bounded_by_length() -> None:
    network = SimActor(LIMIT, generator())
    with torch.no_grad():
        for p in network.head[-1].parameters():
            p.mul_(1e4)
        longest = network(inputs("sim_actor", 16)[0]).norm(dim=1)
    assert float(longest.max()) <= LIMIT * (1 + 1e-6) and float(longest.max()) > 0.99 * LIMIT


def test_bound_is_the_identity_near_zero_and_smooth_at_zero() -> None:
    raw = torch.tensor([[1e-4, -2e-4, 0.0], [0.0, 0.0, 0.0]], dtype=torch.float64, requires_grad=True)
    out = bound_length(raw, 0.5)
    torch.testing.assert_close(out, 0.5 * raw, rtol=1e-4, atol=0)
    assert bool((out[1] == 0).all())
    out.sum().backward()
    assert bool(torch.isfinite(raw.grad).all())
    wide = torch.randn((4, 3), generator=generator(), dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda v: bound_length(v, 0.5), wide)


def test_residual_is_exactly_zero_at_first_and_can_be_trained() -> None:
    network = ResidualActor(LIMIT, generator())
    image, nominal = inputs("residual_actor")
    out = network(image, nominal)
    assert torch.equal(out, torch.zeros(3, 3))
    (out - 1e-3).square().sum().backward()
    assert int(torch.count_nonzero(network.head[-1].weight.grad)) > 0


def test_residual_is_the_mean_over_what_may_be_shown() -> None:
    """Of the same draws each time, for each row alone; plain where everything is seen."""
    network = ResidualActor(LIMIT, generator())
    image, nominal = inputs("residual_actor")
    with torch.no_grad():
        network.head[-1].weight.normal_(generator=generator())  # ty: ignore[not-callable]
        features = network.encoder(image)
        assert torch.equal(network(image, nominal), network.of_features(features, nominal))
        network.keep_prob.fill_(0.25)
        acting = network(image, nominal)
        assert torch.equal(acting, network(image, nominal))
        torch.testing.assert_close(acting[1:2], network(image[1:2], nominal[1:2]))
        assert float(acting.norm(dim=1).max()) <= LIMIT
        drawn = torch.rand((4000, FEATURES), generator=generator())
        many = network.of_features(drop_features(features[:1], 0.25, drawn), nominal[:1].expand(4000, 3))
        for share in (0.0, -0.5, 1.5, float("nan")):
            network.keep_prob.fill_(share)
            with pytest.raises(InputError, match="keep_prob is"):
                network(image, nominal)
    assert (acting[0] - many.mean(dim=0)).norm() < 4.0 * (many.std(dim=0) / 8.0).norm()


def test_q_lies_within_zero_and_one_and_depends_on_the_action() -> None:
    network = SensingQ(generator())
    image, action = inputs("sensing_q")
    with torch.no_grad():
        a, b = network(image, action), network(image, -action)
    assert a.shape == (3,) and bool(((a > 0) & (a < 1)).all()) and not torch.equal(a, b)


def test_residual_has_its_own_copy_of_an_encoder_that_stands_still() -> None:
    encoder = SimActor(LIMIT, generator()).encoder
    network = ResidualActor(LIMIT, generator(), encoder)
    image, nominal = inputs("residual_actor")
    with torch.no_grad():
        features = encoder(image)
        network.head[-1].weight.fill_(0.01)  # ty: ignore[not-callable]
        assert torch.equal(network(image, nominal), network.of_features(features, nominal))
        encoder.out.bias.add_(1.0)  # ty: ignore[not-callable]
        assert torch.equal(network.encoder(image), features)
    assert [name for name, p in network.named_parameters() if p.requires_grad] == [
        f"head.{k}.{part}" for k in (0, 2, 4) for part in ("weight", "bias")
    ]


def test_critics_differ() -> None:
    network = TwinCritic(LIMIT, generator())
    features, nominal, residual = torch.rand(3, FEATURES), 1e-3 * torch.randn(3, 3), 1e-3 * torch.randn(3, 3)
    first, second = network(features, nominal, residual)
    assert first.shape == second.shape == (3,) and not torch.equal(first, second)


def test_key_points_are_the_mean_of_the_known_points_under_the_weights() -> None:
    g = generator()
    xyz = torch.randn((2, 3, 8, 8), generator=g)
    xyz[:, :, :3] = 0.0
    xyz[:, :, 3, :5] = 0.0
    logits = torch.randn((2, 4, 4, 4), generator=g)
    found = key_points(xyz, logits)
    for b in range(2):
        for k in range(4):
            weights, means = [], []
            for i in range(4):
                for j in range(4):
                    cell = xyz[b, :, 2 * i : 2 * i + 2, 2 * j : 2 * j + 2].reshape(3, 4)
                    known = cell[:, (cell != 0).any(dim=0)]
                    if known.shape[1]:
                        weights.append(logits[b, k, i, j].exp())
                        means.append(known.mean(dim=1))
            w = torch.stack(weights)
            expected = (w[:, None] * torch.stack(means)).sum(dim=0) / w.sum()
            torch.testing.assert_close(found[b, k], expected)


def test_nothing_seen_at_all_is_still_finite() -> None:
    network = SimActor(LIMIT, generator())
    image = inputs("sim_actor")[0]
    image[:, 3:] = 0.0
    assert bool(torch.isfinite(network(image)).all())


def test_autocast_keeps_the_key_points_in_single_precision() -> None:
    g = generator()
    xyz = 1.0 + 0.01 * torch.randn((1, 3, 8, 8), generator=g)
    exact = xyz.mean(dim=(-2, -1))
    with torch.autocast("cpu", dtype=torch.bfloat16):
        points = key_points(xyz, torch.zeros(1, 2, 8, 8, dtype=torch.bfloat16))
        action = SimActor(LIMIT, generator())(inputs("sim_actor")[0])
    assert points.dtype == action.dtype == torch.float32
    torch.testing.assert_close(points[:, 0], exact, rtol=0, atol=1e-6)  # bfloat16 would be off by 4e-3


@pytest.mark.parametrize("limit", [0.0, -0.1, 1.0, float("nan")])
def test_a_limit_that_is_none_is_refused(limit: float) -> None:
    with pytest.raises(InputError, match="limit"):
        SimActor(limit)
