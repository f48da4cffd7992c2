"""Stepwise regression by BIC: forward, backward and swap moves on the stacked balances.

    BIC = RSS + k ln(n) + 2 ln(candidates) for each column

with the noise known (the balances are in its units), n the number of rows. Textbook otherwise; a column must have the sign and
the least size that its effect can have.
"""

import numpy as np

from naming import Choice, fit, stands

MOST = 4
# Differences of BIC below which two explanations count as alike (Kass and Raftery 1995: 10 is very strong evidence).
ALIKE = 10.0


def select(regression):
    gram = regression.columns.T @ regression.columns
    right = regression.columns.T @ regression.y
    problem = Problem(gram, right, float(regression.y @ regression.y), len(regression.y), regression)
    chosen, best = [], problem.bic([])
    while True:
        moves = list(problem.moves(chosen))
        scored = [(problem.bic(move), move) for move in moves]
        scored = sorted((score, move) for score, move in scored if score < best - 1e-9)
        taken = next(((score, move) for score, move in scored if problem.sure(move)), None)
        if taken is None:
            break
        best, chosen = taken
    coefficients = fit(regression, chosen) if chosen else np.zeros(0)
    return Choice(chosen, coefficients, problem.alternatives(chosen, best), problem.single_scores())


class Problem:
    """The Gram matrix, on which a set of columns is scored without touching the rows."""

    def __init__(self, gram, right, whole, rows, regression):
        self.gram, self.right, self.whole, self.rows = gram, right, whole, rows
        self.regression = regression
        self.candidates = regression.candidates
        strength = np.sqrt(np.diag(gram))
        self.live = [place for place in range(len(right)) if strength[place] > 1.0]

    def solve(self, chosen):
        part = self.gram[np.ix_(chosen, chosen)]
        try:
            return np.linalg.solve(part + 1e-9 * np.diag(np.diag(part)), self.right[chosen])
        except np.linalg.LinAlgError:
            return None

    def bic(self, chosen):
        if not chosen:
            return self.whole
        coefficients = self.solve(chosen)
        if coefficients is None:
            return np.inf
        if not all(self.candidates[p].plausible(c) for p, c in zip(chosen, coefficients, strict=True)):
            return np.inf
        left = self.whole - float(coefficients @ self.right[chosen])
        return left + len(chosen) * (np.log(self.rows) + 2 * np.log(len(self.live)))

    def moves(self, chosen):
        """Sets that differ by one column added, exchanged or taken away."""
        free = [place for place in self.live if place not in chosen and not self.rival(place, chosen)]
        if len(chosen) < MOST:
            yield from (sorted([*chosen, place]) for place in free)
        for out in chosen:
            rest = [place for place in chosen if place != out]
            yield rest
            yield from (sorted([*rest, place]) for place in self.live if place not in chosen and not self.rival(place, rest))

    def rival(self, place, chosen):
        """Another amount of the same shape is no second effect."""
        one = self.candidates[place]
        same = [self.candidates[other] for other in chosen if self.key(other) == self.key(place)]
        return any(c.key == one.key or "grid" in (c.law, one.law) for c in same)

    def sure(self, chosen):
        """Whether each column stands by clustered errors."""
        if not chosen:
            return True
        return stands(self.regression, chosen, fit(self.regression, chosen))

    def alternatives(self, chosen, best):
        out = {}
        for place in chosen:
            rest = [other for other in chosen if other != place]
            scored = sorted((self.bic(sorted([*rest, other])), other) for other in self.live if other not in chosen)
            mine, found = self.key(place), {}
            for score, other in scored:
                if score < best + ALIKE and self.key(other) != mine and not self.rival(other, rest):
                    found.setdefault(self.key(other), other)
            out[place] = list(found.values())[:4]
        return out

    def key(self, place):
        one = self.candidates[place]
        return one.effect, one.place, one.element

    def single_scores(self):
        """Gain in BIC of each column by itself."""
        return {place: self.whole - self.bic([place]) for place in self.live}
