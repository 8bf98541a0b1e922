"""How much of a channel is noise: its level, its autocorrelation, and how many of its samples are independent.

Windows of 48 samples lose a cubic by least squares; those that then hold little more than the quietest are kept. With
residuals r = Q x, Q = 1 - P, the sums c_k = sum_i r_i r_(i+k) of noise with autocovariances gamma_j, j <= 8, have

    E[c_k] = sum_j A_kj gamma_j,   A_kj = tr(Q S_k Q T_j)                                           (N1)

(S_k shifts by k, T_j is the symmetric Toeplitz matrix of lag j), which is solved for gamma: what the cubic takes along
is given back. Noise that stays correlated over the window, as behind a channel filter, is looked at again on every
second, fourth, ... sample: taking every s-th sample leaves its variance as it is.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAGS, LENGTH, DEGREE = 8, 48, 3
STRIDES = (1, 2, 4, 8, 16, 32, 64, 128)
USUAL = 1.4826  # standard deviation of a normal distribution over its median absolute deviation
QUIET = 2.5  # of the energy of the quiet windows, what still counts as quiet
ORDER = 12  # of the longest autoregression tried


@dataclass(frozen=True, kw_only=True)
class NoiseFloor:
    """Noise of one channel: `sigma` in its unit, and its autocorrelation x_t = sum_k ar_k x_(t-k) + e_t.

    `independence` samples count as one independent sample of a mean, at least 1; `windows` is how many were quiet.
    Noise far below the sampling rate (a channel filter at 10 kHz) is drawn well by `ar`, but not whitened by it: its
    steps are too small. Use `effective` there.
    """

    sigma: float
    ar: tuple[float, ...]
    independence: float
    windows: int

    def effective(self, count: int) -> float:
        """How many independent samples `count` consecutive ones are worth."""
        return max(1.0, count / self.independence)

    def of_mean(self, count: int) -> float:
        """Standard error of a mean over `count` consecutive samples."""
        return float(self.sigma / np.sqrt(self.effective(count)))

    def drawn(self, count: int, random: np.random.Generator, draws: int = 1) -> Array:
        """Noise of this level and autocorrelation, (draws, count)."""
        from scipy.signal import lfilter

        lead = 200 + 20 * int(self.independence) if self.ar else 0
        noise = random.standard_normal((draws, count + lead))
        if self.ar:
            noise = lfilter([1.0], [1.0, *(-a for a in self.ar)], noise, axis=1)[:, lead:]
        return np.asarray(noise * (self.sigma / grown(self.ar)))


def noise_floor(values: Array, order: int | None = None, strides: Sequence[int] = STRIDES) -> NoiseFloor:
    """Noise floor of a channel from evenly spaced samples (n,), whatever else it shows; n at least 48.

    `order` is that of the autoregression, at most 8; by default a criterion chooses it, which needs many windows.
    `strides` are those looked at: (1,) for noise that is known not to outlast a window.
    Exactly repeated or smooth values give sigma 0. Raises ``ValueError`` for fewer samples.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.size < LENGTH:
        raise ValueError(f"values: too few for a noise floor, got {values.size}; at least {LENGTH} are needed")
    best: tuple[int, Array, int] | None = None
    for stride in strides:
        if values.size < LENGTH * stride or (stride > 1 and values.size < 4 * LENGTH * stride):
            break
        gamma, windows = _autocovariance(values, stride)
        best = (stride, gamma, windows) if best is None or gamma[0] > best[1][0] else best
        if gamma[0] <= _rounding(values):
            continue  # so smooth here that only rounding is left; noise, if any, is slower
        rho = gamma / gamma[0]
        unsure = 3.0 / np.sqrt(max(1, windows) * stride * LENGTH)
        if abs(rho[1]) < 0.9 and np.max(np.abs(rho[LAGS // 2 :])) < 0.12 + unsure:
            best = (stride, gamma, windows)
            break
    assert best is not None
    stride, gamma, windows = best
    if gamma[0] <= _rounding(values):
        return NoiseFloor(sigma=0.0, ar=(), independence=1.0, windows=windows)
    rho = gamma / gamma[0]
    shown = np.flatnonzero(np.abs(rho[1:]) < 2.0 / np.sqrt(windows * LENGTH))  # sum up to where nothing is left
    until = int(shown[0]) if shown.size else LAGS
    independence = max(1.0, stride * (1.0 + 2.0 * float(np.sum(rho[1 : until + 1]))))
    if stride == 1 and until == 0:
        independence = 1.0
    return NoiseFloor(
        sigma=float(np.sqrt(gamma[0])),
        ar=_autoregression(values, stride, gamma, order),
        independence=independence,
        windows=windows,
    )


def _rounding(values: Array) -> float:
    """Variance below which residuals are the arithmetic's own."""
    with np.errstate(over="ignore"):  # beyond 1e167 no variance is a number: all of it is rounding
        return float((64.0 * np.finfo(float).eps * np.max(np.abs(values))) ** 2)


@functools.cache
def _basis(length: int) -> Array:
    """Orthonormal polynomials up to the cubic, (length, 4); P = B B'."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, length), DEGREE + 1))
    return np.asarray(basis)


@functools.cache
def _system() -> Array:
    """A of (N1), (LAGS + 1, LAGS + 1)."""
    Q = np.eye(LENGTH) - _basis(LENGTH) @ _basis(LENGTH).T
    A = np.empty((LAGS + 1, LAGS + 1))
    for k in range(LAGS + 1):
        M = Q @ np.eye(LENGTH, k=k) @ Q
        for j in range(LAGS + 1):
            A[k, j] = np.trace(M, offset=j) + (np.trace(M, offset=-j) if j else 0.0)
    return A


def _windows(values: Array, length: int, stride: int) -> Array:
    """Residuals (w, stride, length) of windows of every stride-th sample after their cubic, the quiet ones."""
    span = length * stride
    count = values.size // span
    x = values[: count * span].reshape(count, length, stride).transpose(0, 2, 1)
    x = x - x.mean(axis=2, keepdims=True)
    r = x - (x @ _basis(length)) @ _basis(length).T
    energy = np.einsum("wsl,wsl->w", r, r)
    level = float(np.quantile(energy, 0.2, method="higher"))
    for _ in range(3):
        level = float(np.median(energy[energy <= QUIET * level]))
    return np.asarray(r[energy <= QUIET * level])


def _autocovariance(values: Array, stride: int) -> tuple[Array, int]:
    """gamma (LAGS + 1,) at multiples of the stride, by (N1), and the number of quiet windows."""
    r = _windows(values, LENGTH, stride)
    c = np.array([np.sum(r[..., : LENGTH - k] * r[..., k:]) for k in range(LAGS + 1)]) / (r.shape[0] * stride)
    return np.linalg.solve(_system(), c), len(r)


def _autoregression(values: Array, stride: int, at_stride: Array, wanted: int | None) -> tuple[float, ...]:
    """Coefficients of the autoregression (Yule-Walker) of an order wanted, or that the Bayesian criterion chooses."""
    r = _windows(values, LENGTH * stride, 1)[:, 0, :]
    n, length = r.size, r.shape[1]
    if stride == 1:
        gamma = at_stride
    else:  # what the cubic of so long a window takes along is slow: the same at all of the few lags
        gamma = np.array([np.mean(r[:, : length - k] * r[:, k:]) * (length - k) / length for k in range(ORDER + 1)])
        gamma = gamma + max(0.0, at_stride[0] - gamma[0])
    top = gamma.size - 1
    from scipy.linalg import solve_toeplitz

    ridge = gamma.copy()
    ridge[0] *= 1.0 + 1e-8
    best: tuple[float, tuple[float, ...]] = (0.0, ())
    for order in range(1, top + 1) if wanted is None else (wanted,):
        a = solve_toeplitz(ridge[:order], gamma[1 : order + 1])
        if np.max(np.abs(np.roots([1.0, *(-a)]))) > 0.9995:
            continue  # not stationary: the estimate of gamma need not be that of any process
        left = 1.0 - float(a @ gamma[1 : order + 1]) / gamma[0]
        score = n * np.log(max(left, 1e-12)) + 2.0 * order * np.log(n)
        if score < best[0] or wanted is not None:
            best = (score, tuple(float(v) for v in a))
    return best[1]


@functools.lru_cache(maxsize=256)
def grown(ar: tuple[float, ...]) -> float:
    """Standard deviation of an autoregression, whose roots lie within the unit circle, over that of what drives it."""
    if not ar:
        return 1.0
    from scipy.signal import lfilter

    impulse = np.zeros(20_000)
    impulse[0] = 1.0
    return float(np.sqrt(np.sum(lfilter([1.0], [1.0, *(-a for a in ar)], impulse) ** 2)))
