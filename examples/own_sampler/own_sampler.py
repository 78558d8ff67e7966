"""Search with a sampler of Optuna's, in a study of one's own.

    python examples/own_sampler/own_sampler.py

The objective is the expected shift time at one operating point. A dog that cannot
be made is pruned.
"""

from __future__ import annotations

import optuna

import dogshape as ds


def objective(trial: optuna.Trial, angles: int) -> float:
    """Simulate the expected shift time of a proposed dog, s."""
    dog = {
        "chamfer_deg": trial.suggest_float("chamfer_deg", 6.0, 16.0),
        "height_mm": trial.suggest_float("height_mm", 2.4, 4.0),
        "count": trial.suggest_int("count", 12, 24),
    }
    try:
        found = ds.Study("mq200_paper", **dog).expect(
            mismatch_rpm=100, force_N=469, angles=angles, jobs=1
        )
    except ds.DogshapeError as error:
        raise optuna.TrialPruned(str(error)) from error
    trial.set_user_attr("standard_error_s", found.standard_error_s)
    return found.time_s


def main(trials: int = 8, angles: int = 6) -> optuna.Study:
    """Search ``trials`` designs by Optuna's TPE, each at ``angles`` relative angles."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(sampler=optuna.samplers.TPESampler(seed=1))
    study.optimize(lambda trial: objective(trial, angles), n_trials=trials)
    best = study.best_trial
    error = best.user_attrs["standard_error_s"]
    print(f"{best.value * 1e3:.1f} ± {error * 1e3:.1f} ms with {best.params}")
    return study


if __name__ == "__main__":
    main()
