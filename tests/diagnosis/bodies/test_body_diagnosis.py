"""Tracks of free bodies: what is named, left open and refused, in worlds of SciPy."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyModel, BodyRecording, BodyTolerances, BodyTrack, Support
from samrl_core.common.errors import InputError
from samrl_core.diagnosis.diagnose import DiagnosisSettings, diagnose
from samrl_core.diagnosis.kinds.bodies.body_tracks import BodyTracks, split_bodies, split_body
from samrl_core.diagnosis.residuals.bodies.find_segments import find_segments
from samrl_core.diagnosis.residuals.bodies.free_rotation import free_rotation
from samrl_core.diagnosis.residuals.bodies.phase_search import find_phases
from samrl_core.diagnosis.residuals.bodies.stray_poses import held_poses, stray_poses
from samrl_core.diagnosis.residuals.likelihood import Likelihood
from samrl_core.diagnosis.result import Diagnosis
from tests.diagnosis.bodies.body_worlds import G, Tracker, World, bounces, several, slide, toss

COUNT = 6


def told(recordings: list[BodyRecording], library: tuple[str, ...] | None = None) -> Diagnosis:
    fit, held_out, _ = split_bodies(recordings)
    return diagnose(fit, held_out, DiagnosisSettings(library=library))[0]


def only(d: Diagnosis) -> dict[str, tuple[float, float, float]]:
    """Value and interval of each parameter of the only effect."""
    (effect,) = d.effects
    return {name: (e.value, *e.ci95) for name, e in effect.parameters.items()}


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("make", [toss, slide, bounces])
def test_bodies_within_tolerances_have_no_gap(make, seed: int) -> None:
    assert told(several(make, World(), COUNT, seed)).verdict == "no_gap"


def test_friction_is_named_with_its_size() -> None:
    d = told(several(slide, World(friction=0.22), COUNT, 1))
    assert d.verdict == "effect" and d.effects[0].name == "contact_friction@body:puck"
    value, low, high = only(d)["mu"]
    assert low < 0.22 < high and abs(value - 0.22) < 0.01
    assert d.gap is not None and d.gap.shrink is not None and d.gap.shrink > 0.5


def test_friction_that_grows_with_speed_is_no_drag_by_its_square() -> None:
    """A drag was friction that grows with speed, and of a coefficient that it did not have."""
    ice = Support(friction=0.03)
    d = told(several(slide, World(friction=0.03, drag=0.3), COUNT, 5, support=ice))
    assert d.verdict == "none_of_mine" and "square of the speed" in " ".join(d.reasons)
    d = told(several(slide, World(friction=0.03, viscous=0.04), COUNT, 1, support=ice))
    assert d.verdict == "effect" and d.effects[0].name == "contact_friction@body:puck"
    _, low, high = only(d)["b"]
    assert low < 0.04 < high and high - low < 0.02


def test_a_table_that_leans_is_told_from_friction_by_slides_in_several_directions() -> None:
    d = told(several(slide, World(gravity=(0.45, 0.0, -9.8)), COUNT, 1))
    assert d.verdict == "effect" and d.effects[0].name == "base_tilt@cell"
    found = only(d)
    assert abs(found["ay"][0] + np.arctan2(0.45, 9.8)) < 0.006 and abs(found["ax"][0]) < 0.006
    # The way of the first recording alone makes it no lean along that way, with too narrow an interval.
    assert d.effects[0].form != "one way" and found["ax"][1] < 0.0 < found["ax"][2]


LEAN = (-0.020, -0.015, 1.0)  # normal of a table that leans by four and three times the tolerance


def test_a_lean_of_a_few_tolerances_is_seen_and_the_tolerances_at_their_ends_are_none() -> None:
    """Slides show the support against gravity alone; a frame that leans with its table shows nothing."""
    d = told(several(slide, World(normal=LEAN), 8, 1))
    assert d.verdict == "effect" and d.effects[0].name == "base_tilt@cell"
    low = World(normal=(-0.005, 0.005, 1.0), gravity=(-0.005 * G, 0.005 * G, -G))
    assert told(several(slide, low, 8, 1)).verdict == "no_gap"
    whole = World(normal=LEAN, gravity=(0.020 * G, 0.015 * G, -G))
    assert told(several(slide, whole, 8, 1)).verdict == "no_gap"


@pytest.mark.parametrize(("way", "inertia"), [((1.0, -1.0), 2 / 5), ((1.0, 1.0), 1 / 2)])
def test_what_rolls_down_an_incline_is_no_friction_and_no_tilt(
    way: tuple[float, float], inertia: float
) -> None:
    """Nobody stated a shape: part of the pull turns it, up and down, or down alone."""
    slope, rng, time = np.deg2rad(15.0), np.random.default_rng(3), np.arange(0.0, 0.9, 1 / 120)
    gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    runs = []
    for k in range(6):
        speed = -1.5 if way[k % 2] < 0 else rng.uniform(0.1, 0.4)
        path = speed * time + 0.5 * gravity[0] / (1.0 + inertia) * time**2
        position = np.column_stack([path, rng.uniform(-0.3, 0.3) * time, 0 * time])
        position[:, :2] += 4e-4 * rng.standard_normal((len(time), 2))
        track, plane = BodyTrack(time, position, "xy"), Support(friction=0.1)
        runs.append(BodyRecording(f"{k}", "made", f"{k:064x}", track, BodyModel("thing"), plane, gravity))
    d, _ = diagnose(runs[:4], runs[4:])
    assert d.verdict == "none_of_mine", (d.verdict, [e.name for e in d.effects])
    assert any("a body that rolls" in reason for reason in d.reasons), d.reasons


def test_in_one_direction_friction_and_a_lean_are_one_and_the_next_slides_split_them() -> None:
    d = told(several(slide, World(friction=0.2), COUNT, 1, way=0.4))
    assert d.verdict == "ambiguous"
    assert set(d.ambiguity_set[0]) == {"contact_friction@body:puck", "base_tilt@cell"}
    assert d.next_experiment is not None and d.next_experiment.separates > 0.9
    assert d.next_experiment.programme["motion"] == "slides"


@pytest.mark.thorough
def test_a_rate_and_a_length_that_are_wrong_are_one_in_a_fall_and_no_recording_splits_them() -> None:
    for tracker in (Tracker(clock=1.2), Tracker(scale=1.0 / 1.44)):
        d = told(several(toss, World(tracker=tracker), COUNT, 3))
        assert d.verdict == "ambiguous" and d.next_experiment is None
        assert set(d.ambiguity_set[0]) == {"clock_offset@sensor:camera", "object_geometry@body:cube"}
        assert any("a clock that is filmed" in reason for reason in d.reasons)
        drift = d.effects[0].parameters.get("drift")
        size = d.effects[0].parameters.get("s")
        assert (drift is None or abs(drift.value - 0.2) < 0.01) and (
            size is None or abs(size.value - 0.44) < 0.02
        )


@pytest.mark.thorough
def test_gravity_from_elsewhere_is_named_by_tosses() -> None:
    d = told(several(toss, World(gravity=(0.0, 0.5, -9.8)), COUNT, 2, turns=False))
    assert d.verdict == "effect" and d.effects[0].name == "base_tilt@cell"
    assert abs(only(d)["ax"][0] - np.arctan2(0.5, 9.8)) < 0.005
    assert "object_mass" in d.not_testable and "drops out" in d.not_testable["object_mass"]


def test_a_frame_that_leans_by_far_is_told_with_the_gravity_to_state() -> None:
    """Beyond what a tilt is looked for, it was an unknown force that looked like spin."""
    true = 9.81 * np.array([-0.13, 0.295, -0.947])
    tosses = several(toss, World(gravity=tuple(true)), COUNT, 2, turns=False)
    d = told(tosses)
    assert d.verdict == "none_of_mine"
    (said,) = re.findall(r"state `gravity: \[(.+?)\]`", d.alarms[0])
    stated = tuple(float(x) for x in said.split(","))
    assert np.linalg.norm(np.array(stated) - true) < 0.1
    assert told([replace(r, gravity=stated) for r in tosses]).verdict == "no_gap"


def test_a_centre_of_mass_that_is_elsewhere_is_named_by_turning_tosses() -> None:
    d = told(several(toss, World(center=(0.006, 0.0, -0.004)), COUNT, 4, spin=10.0))
    assert d.verdict == "effect" and d.effects[0].name == "object_mass@body:cube"
    for name, true in (("cx", 0.006), ("cy", 0.0), ("cz", -0.004)):
        value, low, high = only(d)[name]
        assert low < true < high and abs(value - true) < 0.0015


def test_inertia_that_is_far_off_is_named_with_its_size() -> None:
    d = told(several(toss, World(gyration=(1e-3, 1.5e-3, 1.8e-3)), COUNT, 4))
    assert d.verdict == "effect" and d.effects[0].name == "object_mass@body:cube"
    for name, true in (("ix", 1.0 / 1.8 - 1.0), ("iy", 1.5 / 1.8 - 1.0)):
        value, low, high = only(d)[name]
        assert low < true < high and abs(value - true) < 0.05


def test_the_air_slows_a_dense_body_within_tolerance() -> None:
    assert told(several(toss, World(drag=0.012), COUNT, 5, turns=False)).verdict == "no_gap"


def rolling(share: float, angle: float, seed: int) -> list[BodyRecording]:
    """Exact parabolas of a ball that rolls down an incline, at `share` of what it would slide at."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 1.0, 1.0 / 60.0)
    gravity = (G * np.sin(angle), 0.0, -G * np.cos(angle))
    out = []
    for k in range(4):
        along = rng.uniform(-0.5, 0.2) * time + 0.5 * share * gravity[0] * time**2
        position = np.stack([along, 0 * time, 0 * time], axis=1) + 5e-4 * rng.standard_normal((60, 3)) * [
            1,
            0,
            0,
        ]
        ball, plane = BodyModel("ball", "sphere", (0.02,)), Support(friction=0.0, rolls=True)
        track = BodyTrack(time, position, "x")
        out.append(BodyRecording(f"run{k}", "made", f"{k:064x}", track, ball, plane, gravity))
    return out


def test_a_ball_that_rolls_is_solid_or_hollow() -> None:
    assert told(rolling(5.0 / 7.0, 0.2, 1)).verdict == "no_gap"
    d = told(rolling(3.0 / 5.0, 0.2, 1))  # a thin shell: 2/3 m r^2
    names = {e.name for e in d.effects} | {name for group in d.ambiguity_set for name in group}
    assert d.verdict in ("effect", "ambiguous") and "object_mass@body:ball" in names
    sizes = {n: e for effect in (*d.effects, *d.runner_ups) for n, e in effect.parameters.items()}
    assert abs(sizes["k"].value - 2.0 / 3.0) < 0.03


def test_restitution_is_named_with_its_size() -> None:
    d = told(several(bounces, World(restitution=0.72), COUNT, 1))
    assert d.verdict == "effect" and d.effects[0].name == "contact_stiffness@body:ball"
    value, low, high = only(d)["e"]
    assert low < 0.72 < high and abs(value - 0.72) < 0.02


@pytest.mark.parametrize(
    "make, world",
    [
        (toss, World(drag=0.15)),
        (toss, World(lift=(0.4, 0.9, 0.0))),
        (slide, World(push=lambda t: np.array([1.5 * np.sin(12.0 * t), 0.0, 0.0]))),
    ],
    ids=["drag", "spin in air", "pushed"],
)
def test_what_no_effect_describes_is_refused(make, world: World) -> None:
    assert told(several(make, world, COUNT, 5)).verdict == "none_of_mine"


@pytest.mark.thorough
def test_a_family_that_is_withheld_is_not_replaced_by_another() -> None:
    d = told(several(slide, World(friction=0.18), COUNT, 1), ("base_tilt", "object_mass"))
    assert d.verdict in ("none_of_mine", "no_gap")


@pytest.mark.thorough
def test_lost_frames_and_wrong_detections_change_nothing() -> None:
    world = World(gravity=(0.45, 0.0, -9.8), tracker=Tracker(lost=0.08, wrong=0.02))
    d = told(several(toss, world, 9, 3))
    assert d.verdict == "effect" and d.effects[0].name == "base_tilt@cell"
    assert any("stand apart" in note for note in d.notes)


@pytest.mark.thorough
def test_friction_that_nobody_stated_is_solved_for_and_no_gap() -> None:
    support = Support(friction=None)
    d = told(several(slide, World(friction=0.21), COUNT, 1, support=support))
    assert d.verdict == "no_gap" and "solved for" in d.not_testable["contact_friction"]
    (note,) = (n for n in d.notes if "not stated" in n)
    assert abs(float(note.rpartition(" ")[2]) - 0.21) < 0.01


@pytest.mark.parametrize("rate", [30.0, 60.0, 240.0])
def test_flights_and_contact_are_found_wherever_the_support_is(rate: float) -> None:
    world = World(tracker=Tracker(rate=rate, noise=1e-3))
    recording = bounces(world, np.random.default_rng(0), seconds=2.2)
    time, height = recording.track.time, recording.track.position[:, 2] + 0.37
    found = find_phases(time, height, G)
    true = [np.sqrt(2 * 0.6 / G)]
    for k in range(1, 4):
        true.append(true[-1] + 2 * true[0] * 0.6**k)
    flights = [p for p in found if p.kind == "flight"]
    for hit, a, b in zip(true[:3], flights[:3], flights[1:4], strict=False):
        assert time[a.end - 1] < hit + 1.5 / rate and time[b.begin] > hit - 1.5 / rate
    assert found[-1].kind == "contact" and time[found[-1].begin] < 1.8


def test_stamps_beyond_any_clock_are_searched_without_an_overflow() -> None:
    """A damaged text: the square of such a time is no float."""
    recording = bounces(World(tracker=Tracker(rate=100, noise=1e-3)), np.random.default_rng(0), seconds=2.2)
    with np.errstate(over="ignore"):
        assert find_phases(recording.track.time * 1e155, recording.track.position[:, 2] * 1e300, G)


def test_a_toss_without_a_support_leaves_the_hand_out() -> None:
    recording = toss(World(), np.random.default_rng(1), turns=False)
    track = recording.track
    held = np.repeat(track.position[:1], 40, axis=0) + 5e-4 * np.random.default_rng(0).standard_normal(
        (40, 3)
    )
    whole = replace(
        track, time=np.arange(40 + len(track)) / 120.0, position=np.concatenate([held, track.position])
    )
    (segment,) = find_segments(replace(recording, track=whole)).segments
    assert segment.kind == "flight" and abs(segment.time[0] - 40 / 120.0) < 0.03


def test_a_hand_that_carries_its_toss_on_is_none_of_the_flight() -> None:
    """Where a hand eases off some 40 ms of it passed for flight: both together bend as a flight does."""
    recording = toss(World(tracker=Tracker(rate=200.0)), np.random.default_rng(3), turns=False)
    track = recording.track
    speed = (track.position[5] - track.position[0]) / (track.time[5] - track.time[0]) + [0, 0, G * 0.0125]
    part = np.arange(60) / 60.0
    carried = track.position[0] + np.outer(0.3 * (part**3 - part**4 / 2 - 0.5), speed)
    carried += 5e-4 * np.random.default_rng(0).standard_normal((60, 3))
    whole = replace(
        track, time=np.arange(60 + len(track)) / 200.0, position=np.concatenate([carried, track.position])
    )
    (segment,) = find_segments(replace(recording, track=whole)).segments
    assert segment.kind == "flight" and 0.3 <= segment.time[0] < 0.36 and segment.time[-1] > 0.88


def test_a_drag_leaves_a_flight_as_long_as_it_was() -> None:
    """Only a hand is cut off: what bends the whole path is for the diagnosis to see."""
    rests = {}
    for drag in (0.0, 0.1):
        track = toss(World(drag=drag), np.random.default_rng(1), turns=False).track
        held = np.repeat(track.position[:1], 40, axis=0)
        held += 5e-4 * np.random.default_rng(0).standard_normal((40, 3))
        recording = toss(World(), np.random.default_rng(1), turns=False)
        time = np.arange(40 + len(track)) / 120.0
        whole = replace(track, time=time, position=np.concatenate([held, track.position]))
        (segment,) = find_segments(replace(recording, track=whole)).segments
        rests[drag] = len(segment)
    assert abs(rests[0.1] - rests[0.0]) <= 3


def test_two_strays_near_each_other_are_both_found() -> None:
    """Each spoiled the cubics of the other's neighbours: a slide began at one of them."""
    recording = slide(World(tracker=Tracker(rate=60.0)), np.random.default_rng(0))
    position = recording.track.position.copy()
    wrong = [9, 12, 30, 34]
    position[wrong, :2] += [0.03, -0.02]
    assert np.flatnonzero(stray_poses(recording.track.time, position)).tolist() == wrong


def test_a_pose_that_is_repeated_while_the_body_moves_on_is_a_lost_frame() -> None:
    """A tracker that publishes its last pose again for lost frames made friction out of them."""
    track = slide(World(), np.random.default_rng(0), speed=1.5).track
    position = track.position.copy()
    lost = [10, 11, 12, 13, 30, 45, 46]
    for k in lost:
        position[k] = position[k - 1]
    assert np.flatnonzero(held_poses(replace(track, position=position))).tolist() == lost
    # Rounded to a millimetre a body that rests, or creeps, repeats poses that are right.
    rounded = np.round(track.position, 3)
    rounded[-40:] = rounded[-40]
    assert not held_poses(replace(track, position=rounded)).any()


def test_a_recording_without_a_motion_beside_others_is_noted_and_left_out() -> None:
    """Its channels were empty where the others' were not: an IndexError."""
    made = several(slide, World(), 4, 1)
    still = replace(made[0].track, position=0.0 * made[0].track.position)
    fit = [made[0], replace(made[1], track=still), *made[2:]]
    kind = BodyTracks()
    trials, held = kind.trials(fit, [made[1]])
    assert len(trials) == 3 and len(Likelihood(trials).y) and len(Likelihood(held).y)
    assert any(made[1].name in note and "no part of it" in note for note in kind.notes(trials))


def test_strays_are_single_poses_and_impacts_are_none() -> None:
    rng = np.random.default_rng(0)
    recording = bounces(World(tracker=Tracker(rate=60.0)), rng)
    position = recording.track.position.copy()
    assert not stray_poses(recording.track.time, position).any()
    wrong = [11, 40, 41, 70]
    position[wrong] += [0.03, 0.0, 0.02]
    found = set(np.flatnonzero(stray_poses(recording.track.time, position)).tolist())
    impact = round(60.0 * float(np.sqrt(2 * 0.6 / G)))  # the pose of the impact itself may go
    assert set(wrong) <= found <= {*wrong, impact}


def test_free_rotation_is_what_scipy_integrates() -> None:
    inertia, time = np.array([1.0, 2.0, 2.6]), np.arange(0.0, 0.8, 1 / 120)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4], y[4:]
        turn = 0.5 * np.concatenate([q[3] * w + np.cross(q[:3], w), [-q[:3] @ w]])
        return np.concatenate([turn, np.cross(inertia * w, w) / inertia])

    made = solve_ivp(rate, (0, 1), [0, 0, 0, 1, 3, 8, -5], t_eval=time, rtol=1e-10, atol=1e-12).y.T
    turned = Rotation.from_quat(made[:, :4])
    found = free_rotation(time, turned.as_matrix(), inertia)
    assert np.max(np.abs(found.residual)) < 1e-6
    assert np.allclose(found.spin, turned.apply(made[:, 4:]), atol=1e-5)


def test_recordings_that_cannot_be_used_are_refused() -> None:
    one = toss(World(), np.random.default_rng(0))
    with pytest.raises(InputError, match="24 are the least"):
        split_body(replace(one, track=one.track.only(np.arange(20))), 3)
    with pytest.raises(InputError, match="one body"):
        diagnose([one], [replace(one, body=BodyModel("other", "sphere", (0.1,)))])
    with pytest.raises(InputError, match="needs `support`"):
        replace(one, phase="contact")
    with pytest.raises(InputError, match="sum of the others"):
        BodyModel(mass=1.0, inertia=(1.0, 1.0, 3.0))
    with pytest.raises(InputError, match="known are"):
        BodyTolerances.from_mapping({"frction": 0.1})


def test_a_track_without_any_motion_is_not_testable_and_says_what_it_looks_like() -> None:
    recordings = several(toss, World(gravity=(0.0, 0.0, -0.4)), 3, 1)
    d = told(recordings)
    assert d.verdict == "not_testable"
    assert any("as one parabola it accelerates" in note for note in d.notes)


def test_down_a_slope_slides_that_go_up_split_friction_from_a_lean() -> None:
    """Along the slope alone, at 60 Hz: slow slides up it are over before they tell."""
    time = np.arange(0.0, 0.8, 1 / 60)
    slope, rng = np.deg2rad(25.0), np.random.default_rng(8)
    gravity = (9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope))
    downhill = gravity[0] + 0.22 * gravity[2]
    runs = []
    for k in range(5):
        path = 0.5 * downhill * time**2 + rng.uniform(0.1, 0.4) * time + 0.0007 * rng.standard_normal(48)
        track = BodyTrack(time, np.column_stack([path, 0 * path, 0 * path]), "x")
        plane = Support(friction=0.3)
        runs.append(BodyRecording(f"{k}", "made", f"{k:064x}", track, BodyModel("block"), plane, gravity))
    d, _ = diagnose(runs[:3], runs[3:])
    assert set(d.ambiguity_set[0]) == {"contact_friction@body:block", "base_tilt@cell"}
    assert d.next_experiment is not None and d.next_experiment.programme["motion"] == "quick slides"
