"""Three plants with equations of their own: as the engineer models them (TOML), and as they are (right-hand sides for scipy).

A hidden law has another form here than its suspect in the model file has, and every record has a background that no suspect
describes. `variables` are those that a hidden law depends on, `alike` changes a suspect a little, and `amplitude` gives the
number of the suspect that comes nearest to a hidden law on a path, by least squares.
"""

import math

import numpy as np

NAMES = ("drive", "thermal", "oscillator")


class Plant:
    """What all plants share: nominal numbers, and suspects as (place, first lines of TOML, numbers of TOML)."""

    def file(self, guess, without=None, alike=None):
        """The model file with first values of the parameters, less a suspect, with a second one that is alike to another."""
        numbers = "\n".join(
            f'{name} = {{ unit = "{unit}", value = {guess[name]!r}, range = [{guess[name] / 50!r}, {guess[name] * 50!r}] }}'
            for name, (_, unit) in self.numbers.items()
        )
        suspects = "\n".join(
            f'[[suspects]]\nname = "{name}"\nplace = "{place}"\n{text}\n'
            for name, (place, text) in self.with_alike(alike)
            if name != without
        )
        return f"[fit]\nstarts = 0\n[parameters]\n{numbers}\n{self.body}\n{suspects}"


    def with_alike(self, name):
        """All suspects, and one of nearly the same law as `name`."""
        suspects = list(self.suspects.items())
        if name is not None:
            place, text = self.suspects[name]
            old, new = self.alike[name]
            if old not in text:
                raise ValueError(f"{name} has no {old}")
            suspects.append((f"{name}-alike", (place, text.replace(old, new))))
        return suspects


class Drive(Plant):
    """Two inertias and a shaft; the torque acts on the motor, both speeds are measured."""

    name, method, step_s, samples = "drive", "DOP853", 0.005, 1000
    numbers = {
        "jm": (0.05, "kg m^2"),
        "jl": (0.08, "kg m^2"),
        "k": (60.0, "N m"),
        "c": (0.15, "N m s"),
        "bl": (0.08, "N m s"),
    }
    outputs, noise = ("motor", "load"), (0.02, 0.02)
    start = (0.0, 0.0, 0.0, 0.0)
    body = """
[inputs.torque]
unit = "N m"
hold = "linear"
[define]
shaft = "k*twist + c*(wm - wl)"
[states.twist]
unit = "1"
start = 0
derivative = "wm - wl"
[states.angle]
unit = "1"
start = 0
derivative = "wl"
[states.wm]
unit = "1/s"
start = 0
derivative = "(torque - shaft)/jm"
[states.wl]
unit = "1/s"
start = 0
derivative = "(shaft - bl*wl)/jl"
[outputs.motor]
unit = "1/s"
value = "wm"
[outputs.load]
unit = "1/s"
value = "wl"
"""
    suspects = {
        "load-coulomb": ("wl", 'add = "-a*tanh(wl/0.1[1/s])/jl"\nparameters.a = { unit = "N m", value = 0.05, range = [0, 5] }'),
        "motor-coulomb": ("wm", 'add = "-a*tanh(wm/0.1[1/s])/jm"\nparameters.a = { unit = "N m", value = 0.05, range = [0, 5] }'),
        "windage": ("wl", 'add = "-a*wl*abs(wl)/jl"\nparameters.a = { unit = "N m s^2", value = 0.001, range = [0, 1] }'),
        "hard-shaft": ("shaft", 'add = "a*twist^3"\nparameters.a = { unit = "N m", value = 100, range = [-1e5, 1e6] }'),
        "unbalance": ("wl", 'add = "-a*sin(angle)/jl"\nparameters.a = { unit = "N m", value = 0.05, range = [-5, 5] }'),
        "torque-limit": (
            "torque",
            'replace = "torque/sqrt(1 + (torque/a)^2)"\nparameters.a = { unit = "N m", value = 10, range = [0.5, 200] }',
        ),
        "torque-lag": (
            "torque",
            'replace = "late"\nparameters.a = { unit = "s", value = 0.005, range = [0.0005, 0.5] }\n'
            'states.late = { unit = "N m", start = 0, derivative = "(torque - late)/a" }',
        ),
        "speed-offset": ("load", 'add = "a"\nparameters.a = { unit = "1/s", value = 0.01, range = [-5, 5] }'),
    }
    variables = {
        "load-coulomb": {"wl"},
        "motor-coulomb": {"wm"},
        "windage": {"wl"},
        "hard-shaft": {"twist"},
        "unbalance": {"angle"},
        "torque-limit": {"torque"},
        "torque-lag": {"torque"},
        "speed-offset": set(),
    }
    alike = {
        "load-coulomb": ("tanh(wl/0.1[1/s])", "tanh(wl/0.12[1/s])"),
        "motor-coulomb": ("tanh(wm/0.1[1/s])", "tanh(wm/0.12[1/s])"),
        "windage": ("wl*abs(wl)", "wl*sqrt(wl^2 + 0.01[1/s^2])"),
        "hard-shaft": ("twist^3", "twist^3*(1 + twist^2)"),
        "unbalance": ("sin(angle)", "sin(angle + 0.05)"),
        "torque-limit": ("torque/sqrt(1 + (torque/a)^2)", "a*tanh(torque/a)"),
        "torque-lag": ("(torque - late)/a", "(torque - late)/a*(1 + 0.05*tanh(torque/1[N m]))"),
        "speed-offset": ('"a"', '"a*(1 + 0.1*sin(0.5[1/s]*t))"'),
    }
    first = {
        "load-coulomb": 0.1,
        "motor-coulomb": 0.1,
        "windage": 0.004,
        "hard-shaft": 2000.0,
        "unbalance": 0.1,
        "torque-limit": 0.1,
        "torque-lag": 0.004,
        "speed-offset": 0.1,
    }

    def signal(self, random):
        """Torque, N m."""
        return multisine(random, self.samples, self.step_s, 0.3, 7.0, 2.5)

    def rates(self, p, hidden, a, background):
        """State: twist, angle, motor speed, load speed, and two of the lag."""
        jm, jl, k, c, bl = (p[name] for name in self.numbers)

        def law(t, y, u):
            twist, angle, wm, wl, one, two = y
            torque, late = u, (0.0, 0.0)
            if hidden == "torque-limit":
                torque = math.tanh(a * u) / a
            elif hidden == "torque-lag":
                late, torque = ((u - one) / (0.5 * a), (one - two) / (0.5 * a)), two
            shaft = k * twist + c * (wm - wl)
            if hidden == "hard-shaft":
                shaft += a * twist**3 * (1 + 30 * twist * twist)
            load = bl * wl
            motor = background * 0.02 * math.sin(7 * angle)
            if hidden == "load-coulomb":
                load += a * wl / math.sqrt(wl * wl + 0.01)
            elif hidden == "motor-coulomb":
                motor += a * wm / math.sqrt(wm * wm + 0.01)
            elif hidden == "windage":
                load += a * wl * abs(wl) ** 0.85
            elif hidden == "unbalance":
                load += a * (math.sin(angle) + 0.15 * math.sin(2 * angle))
            return (wm - wl, wl, (torque - motor - shaft) / jm, (shaft - load) / jl, *late)

        return law

    def measured(self, y, t, hidden, a):
        """Motor and load speed, 1/s."""
        drift = a * (1 + 0.1 * np.sin(0.5 * t)) if hidden == "speed-offset" else 0.0
        return np.array([y[2], y[3] + drift])

    def amplitude(self, hidden, a, y):
        """The suspect's number, where it is one factor."""
        twist, angle, wm, wl = y[:4]
        forms = {
            "load-coulomb": (wl / np.sqrt(wl * wl + 0.01), np.tanh(wl / 0.1)),
            "motor-coulomb": (wm / np.sqrt(wm * wm + 0.01), np.tanh(wm / 0.1)),
            "windage": (wl * abs(wl) ** 0.85, wl * abs(wl)),
            "hard-shaft": (twist**3 * (1 + 30 * twist * twist), twist**3),
            "unbalance": (np.sin(angle) + 0.15 * np.sin(2 * angle), np.sin(angle)),
        }
        return nearest(a, forms, hidden)


class Thermal(Plant):
    """A heated body in a shell: two temperatures over a reference, heater power and surroundings measured."""

    name, method, step_s, samples = "thermal", "Radau", 2.0, 750
    numbers = {"c1": (200.0, "J/K"), "c2": (500.0, "J/K"), "g1": (5.0, "W/K"), "g2": (3.0, "W/K")}
    outputs, noise = ("body", "shell"), (0.1, 0.1)
    start = (0.0, 0.0)
    body = """
[inputs.power]
unit = "W"
hold = "linear"
[states.inner]
unit = "K"
start = 0
derivative = "(power - g1*(inner - outer))/c1"
[states.outer]
unit = "K"
start = 0
derivative = "(g1*(inner - outer) - g2*outer)/c2"
[outputs.body]
unit = "K"
value = "inner"
[outputs.shell]
unit = "K"
value = "outer"
"""
    suspects = {
        "radiation": (
            "outer",
            'add = "-a*((1 + outer/293[K])^4 - 1)/c2"\nparameters.a = { unit = "W", value = 50, range = [0, 5000] }',
        ),
        "convection": (
            "outer",
            'add = "-a*outer*abs(outer/1[K])^0.25/c2"\nparameters.a = { unit = "W/K", value = 0.1, range = [0, 20] }',
        ),
        "body-loss": ("inner", 'add = "-a*inner/c1"\nparameters.a = { unit = "W/K", value = 0.1, range = [0, 20] }'),
        "boiling": (
            "outer",
            'add = "-a*max(outer - 60[K], 0)/c2"\nparameters.a = { unit = "W/K", value = 0.5, range = [0, 50] }',
        ),
        "hot-heater": (
            "power",
            'multiply = "1/(1 + a*inner)"\nparameters.a = { unit = "1/K", value = 0.001, range = [-0.004, 0.05] }',
        ),
        "heater-lag": (
            "power",
            'replace = "late"\nparameters.a = { unit = "s", value = 5, range = [0.2, 300] }\n'
            'states.late = { unit = "W", start = 0, derivative = "(power - late)/a" }',
        ),
        "heater-limit": (
            "power",
            'replace = "power/sqrt(1 + (power/a)^2)"\nparameters.a = { unit = "W", value = 1000, range = [50, 20000] }',
        ),
        "shell-offset": ("shell", 'add = "a"\nparameters.a = { unit = "K", value = 0.1, range = [-20, 20] }'),
    }
    variables = {
        "radiation": {"outer"},
        "convection": {"outer"},
        "body-loss": {"inner"},
        "boiling": {"outer"},
        "hot-heater": {"power", "inner"},
        "heater-lag": {"power"},
        "heater-limit": {"power"},
        "shell-offset": set(),
    }
    alike = {
        "radiation": ("^4 - 1", "^4.1 - 1"),
        "convection": ("^0.25", "^0.26"),
        "body-loss": ("a*inner", "a*inner*abs(inner/1[K])^0.01"),
        "boiling": ("outer - 60[K]", "outer - 60.5[K]"),
        "hot-heater": ("1/(1 + a*inner)", "exp(-a*inner)"),
        "heater-lag": ("(power - late)/a", "(power - late)/a*(1 + 0.05*tanh(power/200[W]))"),
        "heater-limit": ("power/sqrt(1 + (power/a)^2)", "a*tanh(power/a)"),
        "shell-offset": ('"a"', '"a*(1 + 0.1*sin(t/200[s]))"'),
    }
    first = {
        "radiation": 100.0,
        "convection": 0.3,
        "body-loss": 0.3,
        "boiling": 1.0,
        "hot-heater": 0.001,
        "heater-lag": 10.0,
        "heater-limit": 0.001,
        "shell-offset": 1.0,
    }

    def signal(self, random):
        """Power, W."""
        return np.maximum(
            250 * np.minimum(np.arange(self.samples) / 20, 1) + multisine(random, self.samples, self.step_s, 0.0007, 0.02, 90), 0
        )

    def rates(self, p, hidden, a, background):
        """State: body, shell, and two of the lag."""
        c1, c2, g1, g2 = (p[name] for name in self.numbers)

        def law(t, y, u):
            inner, outer, one, two = y
            power, late = u, (0.0, 0.0)
            if hidden == "heater-lag":
                late, power = ((u - one) / (0.5 * a), (one - two) / (0.5 * a)), two
            elif hidden == "heater-limit":
                power = math.tanh(a * u) / a
            elif hidden == "hot-heater":
                power = u * math.exp(-a * inner)
            flow, loss = g1 * (inner - outer), g2 * (outer - background * 0.6 * math.sin(t / 130))
            if hidden == "radiation":
                loss += a * (1 + 0.001 * outer) * ((1 + outer / 293) ** 4 - 1)
            elif hidden == "convection":
                loss += a * outer * abs(outer) ** 0.33
            elif hidden == "boiling":
                loss += a * 4 * softplus((outer - 60) / 4)
            elif hidden == "body-loss":
                power -= a * inner * (abs(inner) / 100) ** 0.1
            return ((power - flow) / c1, (flow - loss) / c2, *late)

        return law

    def measured(self, y, t, hidden, a):
        """Body and shell, K."""
        offset = a * (1 + 0.1 * np.sin(t / 200)) if hidden == "shell-offset" else 0.0
        return np.array([y[0], y[1] + offset])

    def amplitude(self, hidden, a, y):
        """The suspect's number, where it is one factor."""
        inner, outer = y[:2]
        heat = (1 + outer / 293) ** 4 - 1
        forms = {
            "radiation": ((1 + 0.001 * outer) * heat, heat),
            "convection": (outer * abs(outer) ** 0.33, outer * abs(outer) ** 0.25),
            "boiling": (4 * np.logaddexp(0, (outer - 60) / 4), np.maximum(outer - 60, 0)),
            "body-loss": (inner * (abs(inner) / 100) ** 0.1, inner),
        }
        return nearest(a, forms, hidden)


class Oscillator(Plant):
    """A mass on a spring that a force moves; its position is measured."""

    name, method, step_s, samples = "oscillator", "DOP853", 0.01, 1000
    numbers = {"m": (2.0, "kg"), "k": (400.0, "N/m"), "c": (4.0, "N s/m")}
    outputs, noise = ("position",), (2e-4,)
    start = (0.0, 0.0)
    body = """
[inputs.force]
unit = "N"
hold = "linear"
[states.x]
unit = "m"
start = 0
derivative = "v"
[states.v]
unit = "m/s"
start = 0
derivative = "(force - k*x - c*v)/m"
[outputs.position]
unit = "m"
value = "x"
"""
    suspects = {
        "cubic-spring": ("v", 'add = "-a*x^3/m"\nparameters.a = { unit = "N/m^3", value = 1000, range = [-1e6, 1e7] }'),
        "one-sided-spring": ("v", 'add = "-a*max(x, 0)/m"\nparameters.a = { unit = "N/m", value = 20, range = [-300, 5000] }'),
        "quadratic-damping": ("v", 'add = "-a*v*abs(v)/m"\nparameters.a = { unit = "N s^2/m^2", value = 1, range = [0, 100] }'),
        "coulomb": ("v", 'add = "-a*tanh(v/0.02[m/s])/m"\nparameters.a = { unit = "N", value = 0.5, range = [0, 50] }'),
        "damping-by-place": ("v", 'add = "-a*x^2*v/m"\nparameters.a = { unit = "N s/m^3", value = 100, range = [0, 1e6] }'),
        "force-limit": (
            "force",
            'replace = "force/sqrt(1 + (force/a)^2)"\nparameters.a = { unit = "N", value = 60, range = [3, 2000] }',
        ),
        "force-lag": (
            "force",
            'replace = "late"\nparameters.a = { unit = "s", value = 0.01, range = [0.0005, 1] }\n'
            'states.late = { unit = "N", start = 0, derivative = "(force - late)/a" }',
        ),
        "position-offset": ("position", 'add = "a"\nparameters.a = { unit = "m", value = 0.001, range = [-0.1, 0.1] }'),
    }
    variables = {
        "cubic-spring": {"x"},
        "one-sided-spring": {"x"},
        "quadratic-damping": {"v"},
        "coulomb": {"v"},
        "damping-by-place": {"x", "v"},
        "force-limit": {"force"},
        "force-lag": {"force"},
        "position-offset": set(),
    }
    alike = {
        "cubic-spring": ("x^3", "x^3*(1 + (x/0.2[m])^2)"),
        "one-sided-spring": ("max(x, 0)", "max(x - 0.1[mm], 0)"),
        "quadratic-damping": ("v*abs(v)", "v*sqrt(v^2 + 0.001[m^2/s^2])"),
        "coulomb": ("tanh(v/0.02[m/s])", "tanh(v/0.024[m/s])"),
        "damping-by-place": ("x^2*v", "x^2*v*(1 + (x/0.2[m])^2)"),
        "force-limit": ("force/sqrt(1 + (force/a)^2)", "a*tanh(force/a)"),
        "force-lag": ("(force - late)/a", "(force - late)/a*(1 + 0.05*tanh(force/5[N]))"),
        "position-offset": ('"a"', '"a*(1 + 0.1*sin(0.5[1/s]*t))"'),
    }
    first = {
        "cubic-spring": 5000.0,
        "one-sided-spring": 40.0,
        "quadratic-damping": 3.0,
        "coulomb": 0.8,
        "damping-by-place": 500.0,
        "force-limit": 0.02,
        "force-lag": 0.008,
        "position-offset": 0.001,
    }

    def signal(self, random):
        """Force, N."""
        return multisine(random, self.samples, self.step_s, 0.3, 4.0, 9.0)

    def rates(self, p, hidden, a, background):
        """State: position, speed, and two of the lag."""
        m, k, c = (p[name] for name in self.numbers)

        def law(t, y, u):
            x, v, one, two = y
            force, late = u, (0.0, 0.0)
            if hidden == "force-limit":
                force = math.tanh(a * u) / a
            elif hidden == "force-lag":
                late, force = ((u - one) / (0.5 * a), (one - two) / (0.5 * a)), two
            force -= background * 0.2 * math.sin(120 * x)
            if hidden == "cubic-spring":
                force -= a * x**3 * (1 + 40 * x * x)
            elif hidden == "one-sided-spring":
                force -= a * 0.005 * softplus(x / 0.005)
            elif hidden == "quadratic-damping":
                force -= a * v * abs(v) ** 0.85
            elif hidden == "coulomb":
                force -= a * v / math.sqrt(v * v + 0.0004)
            elif hidden == "damping-by-place":
                force -= a * x * x * v * (1 + 20 * x * x)
            return (v, (force - k * x - c * v) / m, *late)

        return law

    def measured(self, y, t, hidden, a):
        """Position, m."""
        return np.array([y[0] + (a * (1 + 0.1 * np.sin(0.5 * t)) if hidden == "position-offset" else 0.0)])

    def amplitude(self, hidden, a, y):
        """The suspect's number, where it is one factor."""
        x, v = y[:2]
        forms = {
            "cubic-spring": (x**3 * (1 + 40 * x * x), x**3),
            "one-sided-spring": (0.005 * np.logaddexp(0, x / 0.005), np.maximum(x, 0)),
            "quadratic-damping": (v * abs(v) ** 0.85, v * abs(v)),
            "coulomb": (v / np.sqrt(v * v + 0.0004), np.tanh(v / 0.02)),
            "damping-by-place": (x * x * v * (1 + 20 * x * x), x * x * v),
        }
        return nearest(a, forms, hidden)


def softplus(x):
    """log(1 + exp(x)), also where exp overflows."""
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


def nearest(a, forms, hidden):
    """Least squares of the suspect's form on the law's; None for laws that are no factor of one number."""
    if hidden not in forms:
        return None
    law, form = forms[hidden]
    return a * float(law @ form / (form @ form))


def multisine(random, samples, step_s, low_hz, high_hz, rms):
    """A sum of sines with random phases, one for each of 30 frequencies on a logarithmic scale."""
    t = step_s * np.arange(samples)
    frequencies = np.geomspace(low_hz, high_hz, 30)
    signal = sum(np.sin(2 * np.pi * f * t + random.uniform(0, 2 * np.pi)) for f in frequencies)
    return signal * rms / np.sqrt(len(frequencies) / 2)


PLANTS = {"drive": Drive(), "thermal": Thermal(), "oscillator": Oscillator()}
