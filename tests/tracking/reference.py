"""A slow, obvious filter: probabilities on a grid of (log r, rate), moved exactly."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from inference.tracking.settings import TrackingSettings
from simulator.parameters import parameters_of
from simulator.scene import Scene
from simulator.sensor import Sensor
from simulator.simulate import mean_readings

Array = NDArray[np.float64]


@dataclasses.dataclass
class GridFilter:
    """Bayes' rule on cells, without any approximation but the cells.

    The rate is an Ornstein-Uhlenbeck process. Given its values at both ends of a step, the way that
    log r goes is normal with mean tau tanh(dt / 2 tau) (v + v') and variance
    s^2 tau^2 (2 x - 4 tanh(x / 2)), x = dt / tau; the shift is done in Fourier space, where it is
    exact. Absence and presence are a Markov chain of two states.
    """

    sensor: Sensor
    scene: Scene
    settings: TrackingSettings
    span: tuple[float, float]
    cells: int = 2048
    rates: int = 61

    def __post_init__(self) -> None:
        low, high = np.log(self.span)
        self.u = low + (high - low) * (np.arange(self.cells) + 0.5) / self.cells
        self.v = np.linspace(-4.0, 4.0, self.rates) * self.settings.rate_sd
        terms = parameters_of(self.sensor, self.scene).terms(np.zeros((1, 0)))
        self.means = mean_readings(self.sensor, terms, np.exp(self.u))
        self.empty = mean_readings(self.sensor, terms, np.array([np.inf]))[0]
        gauss = np.exp(-0.5 * (self.v / self.settings.rate_sd) ** 2)
        self.prior = np.ones(self.cells)[:, None] * gauss[None, :]
        self.prior /= self.prior.sum()
        there = self.settings.visit_s / (self.settings.visit_s + self.settings.absence_s)
        self.mass, self.absent = there * self.prior, 1.0 - there

    def move(self, seconds: float) -> None:
        s, tau = self.settings.rate_sd, self.settings.rate_time_s
        x = seconds / tau
        spread = s * np.sqrt(-np.expm1(-2 * x))
        step = np.exp(-0.5 * ((self.v[:, None] - np.exp(-x) * self.v[None, :]) / spread) ** 2)
        step /= step.sum(axis=0)
        width = (self.u[1] - self.u[0]) * self.cells
        omega = 2 * np.pi * np.fft.rfftfreq(2 * self.cells, width / self.cells)
        half = np.exp(-1j * omega[:, None] * tau * np.tanh(x / 2) * self.v[None, :])
        blur = np.exp(-0.5 * omega**2 * (s * tau) ** 2 * (2 * x - 4 * np.tanh(x / 2)))
        wave = np.fft.rfft(self.mass, 2 * self.cells, axis=0)
        wave = half * ((half * wave) @ step.T) * blur[:, None]
        moved = np.maximum(np.fft.irfft(wave, axis=0)[: self.cells], 0.0)
        leave, arrive = 1 / self.settings.visit_s, 1 / self.settings.absence_s
        gone = -np.expm1(-(leave + arrive) * seconds)
        arrived, left = arrive / (leave + arrive) * gone, leave / (leave + arrive) * gone
        stayed = np.exp(-leave * seconds)
        total = self.mass.sum()
        new = self.absent * arrived + total * (1.0 - left - stayed)
        self.absent = self.absent * (1.0 - arrived) + total * left
        self.mass = moved * stayed + new * self.prior

    def see(self, readings: Array, known: tuple[float, float] | None = None) -> None:
        """Take in readings, and a known range with its standard deviation [m] if there is one."""
        used = [self.settings.observables != "w2", self.settings.observables != "w1"]
        noise = np.asarray(self.sensor.noise.read)

        def log_likelihood(mean: Array) -> Array:
            return np.asarray(-0.5 * (((readings - mean) / noise) ** 2 * used).sum(axis=-1))

        logs, empty = log_likelihood(self.means), log_likelihood(self.empty)
        if known is not None:
            logs = logs - 0.5 * ((np.exp(self.u) - known[0]) / known[1]) ** 2
            empty = np.full_like(empty, -np.inf)
        top = max(logs.max(), empty)
        self.mass = self.mass * np.exp(logs - top)[:, None]
        self.absent = float(self.absent * np.exp(empty - top))
        total = self.mass.sum() + self.absent
        self.mass, self.absent = self.mass / total, self.absent / total

    @property
    def present(self) -> float:
        return 1.0 - self.absent

    def below(self, u: float) -> float:
        """Probability of a range below exp(u), given that an object is there."""
        return float(self.mass[self.u < u].sum() / self.mass.sum())

    def moments(self) -> tuple[float, float]:
        """Mean and standard deviation of log r, given that an object is there."""
        weight = self.mass.sum(axis=1) / self.mass.sum()
        mean = float(weight @ self.u)
        return mean, float(np.sqrt(weight @ (self.u - mean) ** 2))
