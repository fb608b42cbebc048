"""Actor, sensing-aware Q, residual actor and its critics, all on RGB-XYZ images (see `network_image`).

The encoder has five convolutions and gives 128 features, the heads three layers (SAM-RL, section IV). Next
to pooled features it takes key points: learned maps, each normalised over the image (spatial softmax, Finn
et al. 2016, "Deep spatial autoencoders"), average the XYZ channels instead of the pixel coordinates. A key
point is thus a position relative to the tip in metres, which the image's resolution does not round.

Measured only briefly: 300 steps of 32 on 5000 peg images at 64 x 64, one seed, 200 validation images, action
limit 10 mm. Loss of `imitation` 0.41, error 4.4 mm, near the goal 1.6 mm; with flattened features instead of
key points 0.54, 5.1 mm and 1.3 mm (standing still: 1.0, 8 mm, 2.0 mm). Too short to compare them near the
goal.
"""

from __future__ import annotations

import copy

import torch
from torch import nn
from torch.nn import functional

from samrl_core.common.errors import InputError
from samrl_core.policy.networks.network_image import CHANNELS, XYZ

FEATURES = 128  # of the encoder and of the heads' layers
KEY_POINTS = 32
ACTION_UNIT = 0.01  # [m] per unit in which nominal actions enter a network
_WIDTHS = (32, 64, 64, 96, 96)
_STRIDES = (2, 2, 1, 2, 1)
OLD_KEYS = {"seen": "keep_prob"}  # of tensors in files of earlier versions, and their present names
_MASKS = 64  # dropout masks that an action is averaged over: it has an eighth of one mask's noise
_UNKNOWN = -1e4  # logit of a pixel whose point is unknown: finite, as an image may have no other


class Encoder(nn.Module):
    """Image (B, channels, H, W), XYZ in channels 3 to 5, to features (B, 128).

    Key points and what follows them are worked out in float32 also under autocast: bfloat16 has 8 bits, which
    is 0.4 mm at a decimetre.
    """

    def __init__(self, channels: int, generator: torch.Generator) -> None:
        super().__init__()
        sizes = (channels, *_WIDTHS)
        self.convolutions = nn.ModuleList(
            _convolution(sizes[k], sizes[k + 1], 5 if k == 0 else 3, _STRIDES[k], generator) for k in range(5)
        )
        self.fine = _convolution(_WIDTHS[0], KEY_POINTS, 1, 1, generator)
        self.coarse = _convolution(_WIDTHS[2], KEY_POINTS, 1, 1, generator)
        self.context = _convolution(_WIDTHS[4], KEY_POINTS, 1, 1, generator)
        self.out = _linear(_WIDTHS[4] + 3 * KEY_POINTS, FEATURES, generator)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        """See the class."""
        x, maps = image, []
        for k, convolution in enumerate(self.convolutions):
            x = functional.relu(convolution(x))
            if k in (0, 2, 4):
                maps.append((self.fine, self.coarse, self.context)[k // 2](x))
        size = maps[0].shape[-2:]
        logits = sum(functional.interpolate(m, size=size, mode="nearest") for m in maps[1:]) + maps[0]
        points = key_points(image[:, XYZ], logits)
        with torch.autocast(image.device.type, enabled=False):
            pooled = x.float().mean(dim=(-2, -1))
            return functional.relu(self.out(torch.cat([pooled, points.flatten(1)], dim=1)))


def key_points(xyz: torch.Tensor, logits: torch.Tensor) -> torch.Tensor:
    """Mean of the known points under each map's weights, (B, K, 3), float32 in the units of `xyz`.

    Args:
        xyz: (B, 3, H, W), 0 where unknown.
        logits: (B, K, h, w) of the weights; h and w divide H and W, or nearly.
    """
    with torch.autocast(xyz.device.type, enabled=False):
        xyz, size = xyz.float(), (logits.shape[2], logits.shape[3])
        known = (xyz != 0).any(dim=1, keepdim=True).float()
        share = functional.adaptive_avg_pool2d(known, size)  # of known pixels in each cell
        mean = functional.adaptive_avg_pool2d(xyz, size) / share.clamp(min=1e-6)
        weights = torch.where(share > 0, logits.float(), _UNKNOWN).flatten(2).softmax(dim=2)
        return torch.bmm(weights, mean.flatten(2).transpose(1, 2))


class SimActor(nn.Module):
    """Nominal action from the model's image (pi_s of eq. 23)."""

    def __init__(self, action_limit: float, generator: torch.Generator | None = None) -> None:
        """`action_limit` is the longest action [m]; the generator samples the weights, default seed 0."""
        super().__init__()
        self.action_limit = _limit(action_limit)
        generator = generator or torch.Generator().manual_seed(0)
        self.encoder = Encoder(CHANNELS, generator)
        self.head = _head(FEATURES, 3, generator)

    def forward(self, image: torch.Tensor) -> torch.Tensor:
        """Image (B, 6, H, W) to displacement (B, 3) [m], no longer than the limit."""
        features = self.encoder(image)
        with torch.autocast(image.device.type, enabled=False):
            return bound_length(self.head(features), self.action_limit)


class SensingQ(nn.Module):
    """Expected return of an action, given the image from a view (Q_s of eqs. 17 and 24)."""

    def __init__(self, generator: torch.Generator | None = None) -> None:
        """The generator samples the initial weights, default seed 0."""
        super().__init__()
        generator = generator or torch.Generator().manual_seed(0)
        self.encoder = Encoder(CHANNELS + 3, generator)
        self.head = _head(FEATURES + 3, 1, generator)

    def forward(self, image: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        """Image (B, 6, H, W) and action (B, 3) [m] to return (B,), 0..1."""
        return torch.sigmoid(self.logit(image, action))

    def logit(self, image: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        """Of the return (B,), float32."""
        scaled = action / ACTION_UNIT
        features = self.encoder(_beside(image, scaled))
        with torch.autocast(image.device.type, enabled=False):
            return self.head(torch.cat([features, scaled.float()], dim=1)).squeeze(1)


class ResidualActor(nn.Module):
    """Correction of the nominal action from the real image; exactly zero before it is trained.

    Its encoder is the nominal policy's and frozen, only the head is trained: a few dozen episodes with one
    reward each overfit an encoder (`learning/residual/td3.py`). The head is trained with dropout on the
    features. Without dropout its input differs from the training's: with a `keep_prob` of 0.2 its residuals
    had a third of the trained length. So it acts by the mean over 64 fixed dropout masks (Gal & Ghahramani
    2016, "Dropout as a Bayesian approximation").
    """

    def __init__(
        self, limit: float, generator: torch.Generator | None = None, encoder: Encoder | None = None
    ) -> None:
        """Creates the head.

        Args:
            limit: longest correction [m].
            generator: of the first weights, default seed 0.
            encoder: is copied; None creates one, as for weights that are about to be loaded.
        """
        super().__init__()
        self.limit = _limit(limit)
        generator = generator or torch.Generator().manual_seed(0)
        encoder = Encoder(CHANNELS, generator) if encoder is None else copy.deepcopy(encoder)
        self.encoder = encoder.requires_grad_(False)
        self.head = _head(FEATURES + 3, 3, generator)
        last = self.head[-1]
        assert isinstance(last, nn.Linear)
        nn.init.zeros_(last.weight)
        self.keep_prob: torch.Tensor  # (1,) share of the features that dropout kept in the last update
        self.register_buffer("keep_prob", torch.ones(1))
        uniform = torch.rand((_MASKS, FEATURES), generator=torch.Generator().manual_seed(0))
        self._uniform: torch.Tensor
        self.register_buffer("_uniform", uniform, persistent=False)

    def forward(self, image_real: torch.Tensor, nominal: torch.Tensor) -> torch.Tensor:
        """Real image (B, 6, H, W) and nominal action (B, 3) [m] to residual (B, 3) [m]."""
        return self.mean_of_features(self.encoder(image_real), nominal)

    def mean_of_features(self, features: torch.Tensor, nominal: torch.Tensor) -> torch.Tensor:
        """The same from the encoder's features (B, 128) of the images.

        Raises:
            InputError: the loaded `keep_prob` is not above 0 and at most 1.
        """
        keep_prob = float(self.keep_prob)
        if keep_prob == 1.0:
            return self.of_features(features, nominal)
        if not 0.0 < keep_prob < 1.0:
            raise InputError(f"the residual's keep_prob is {keep_prob}, must be above 0 and at most 1")
        masked = drop_features(features[:, None], keep_prob, self._uniform).flatten(0, 1)
        found = self.of_features(masked, nominal.repeat_interleave(_MASKS, dim=0))
        return found.unflatten(0, (len(features), _MASKS)).mean(dim=1)

    def of_features(self, features: torch.Tensor, nominal: torch.Tensor) -> torch.Tensor:
        """The head on features (B, 128) as they are, all of them or after dropout."""
        with torch.autocast(features.device.type, enabled=False):
            state = torch.cat([features.float(), (nominal / ACTION_UNIT).float()], dim=1)
            return bound_length(self.head(state), self.limit)


class TwinCritic(nn.Module):
    """Two estimates of the return of a residual, in a state given by features and nominal action."""

    def __init__(self, limit: float = ACTION_UNIT, generator: torch.Generator | None = None) -> None:
        """`limit` is the longest residual [m]; the generator samples the weights, default seed 0."""
        super().__init__()
        self.limit = _limit(limit)
        generator = generator or torch.Generator().manual_seed(0)
        self.first = _head(FEATURES + 6, 1, generator, normalised=True)
        self.second = _head(FEATURES + 6, 1, generator, normalised=True)

    def forward(
        self, features: torch.Tensor, nominal: torch.Tensor, residual: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Features (B, 128), nominal and residual (B, 3) [m] to two returns (B,)."""
        with torch.autocast(features.device.type, enabled=False):
            parts = (features, nominal / ACTION_UNIT, residual / self.limit)
            x = torch.cat([part.float() for part in parts], dim=1)
            return self.first(x).squeeze(1), self.second(x).squeeze(1)


def drop_features(features: torch.Tensor, keep_prob: float, uniform: torch.Tensor) -> torch.Tensor:
    """Features (..., 128) over `keep_prob` where the numbers from 0..1 are below it, else 0 (dropout)."""
    return features * (uniform < keep_prob) / keep_prob


def bound_length(raw: torch.Tensor, limit: float) -> torch.Tensor:
    """limit tanh(|v|) v / |v| of rows v (B, 3): no row is longer than the limit, and 0 stays 0."""
    length = (raw.square().sum(dim=-1, keepdim=True) + 1e-12).sqrt()  # finite gradient at 0
    return limit * raw * torch.tanh(length) / length


def _beside(image: torch.Tensor, scaled: torch.Tensor) -> torch.Tensor:
    """Image with the action as constant channels, as the paper feeds it, (B, 9, H, W)."""
    planes = scaled.to(image.dtype)[:, :, None, None].expand(-1, -1, *image.shape[-2:])
    return torch.cat([image, planes], dim=1)


def _limit(value: float) -> float:
    if not 0.0 < value < 1.0:
        raise InputError(f"action limit is {value} m, must be above 0 and below 1 m")
    return float(value)


def _head(inputs: int, outputs: int, generator: torch.Generator, normalised: bool = False) -> nn.Sequential:
    layers: list[nn.Module] = []
    for width in (inputs, FEATURES):
        layers.append(_linear(width, FEATURES, generator))
        if normalised:
            layers.append(nn.LayerNorm(FEATURES))  # bounds what critics extrapolate to unseen actions
        layers.append(nn.ReLU())
    return nn.Sequential(*layers, _linear(FEATURES, outputs, generator, gain=0.1))


def _convolution(inputs: int, outputs: int, size: int, stride: int, generator: torch.Generator) -> nn.Module:
    with torch.random.fork_rng(devices=()):  # torch's own first weights are not kept
        layer = nn.Conv2d(inputs, outputs, size, stride=stride, padding=size // 2)
    return _initialised(layer, generator, 1.0)


def _linear(inputs: int, outputs: int, generator: torch.Generator, gain: float = 1.0) -> nn.Module:
    with torch.random.fork_rng(devices=()):
        layer = nn.Linear(inputs, outputs)
    return _initialised(layer, generator, gain)


def _initialised(layer: nn.Module, generator: torch.Generator, gain: float) -> nn.Module:
    """First weights after He et al. 2015 for layers with ReLU, times a gain; biases 0."""
    with torch.no_grad():
        weight, bias = layer.get_parameter("weight"), layer.get_parameter("bias")
        nn.init.kaiming_normal_(weight, nonlinearity="relu", generator=generator)
        weight.mul_(gain)
        bias.zero_()
    return layer
