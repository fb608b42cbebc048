"""What each family of effects is, in words for whoever stands beside the machine: title, meaning, remedy.

Names and numbers are those of the contract's catalogue; models and ranges stand with the effects themselves.
"""

from __future__ import annotations

from typing import NamedTuple

from samrl_core.common.errors import InputError


class Family(NamedTuple):
    """A family of the catalogue."""

    number: int
    name: str  # as in `family@place`
    title: str  # starts a sentence
    meaning: str  # one sentence: what it physically is
    remedy: str  # one or two sentences: what to do about it


_ROWS = (
    # joints and drives
    (1, "coulomb_friction", "Coulomb friction",
     "A torque of constant size opposes the motion, so the joint needs a push to start and stops off target.",
     "Add the friction level to the joint's model or compensate it in the controller; if it is far above the "
     "datasheet, check brake, seal and lubrication."),
    (2, "viscous_friction", "Viscous friction",
     "A torque that grows in proportion to joint speed brakes the motion.",
     "Set the joint's damping in the model to the fitted value; it depends on grease and temperature, so "
     "measure again warm."),
    (3, "stribeck_friction", "Stribeck friction",
     "Friction is higher near standstill than at speed, which makes slow motion stick and slip.",
     "Model friction with its falling part at low speed, or keep slow moves above the Stribeck speed."),
    (4, "load_dependent_friction", "Load-dependent friction",
     "The gear rubs harder the more torque it transmits, so friction changes with pose and payload.",
     "Make the friction in the model a function of transmitted torque; do not tune it at one payload only."),
    (5, "presliding", "Presliding friction",
     "Before it slides, the contact bends like a stiff lossy spring, so tiny moves show hysteresis loops.",
     "Use a friction model with a bristle state (LuGre, Dahl) if millirad accuracy or contact matters."),
    (6, "friction_asymmetry", "Direction-dependent friction",
     "Friction differs between the two directions of motion.",
     "Give the model one level per direction; a large difference hints at a preloaded or damaged gear."),
    (7, "position_dependent_friction", "Position-dependent friction",
     "Friction changes with joint angle and repeats there, as with a bent shaft or an uneven gear.",
     "Add a friction table over the angle; inspect the bearing at the angles where the curve peaks."),
    (8, "gear_ripple", "Gear torque ripple",
     "Tooth meshing adds a torque that oscillates with motor angle at a fixed count per turn.",
     "Add the ripple with its order and amplitude, or filter at that order; avoid speeds where it meets a "
     "resonance."),
    (9, "thermal_friction", "Friction that drifts with temperature",
     "Friction falls or rises while the drive warms up.",
     "Warm the arm up before recording or learning, or let the model's friction follow time or temperature."),
    (10, "backlash", "Backlash",
     "The gear has play: at load reversal the motor turns a little before the link follows.",
     "Model the dead zone or preload the joint; if it exceeds the datasheet, have the gear serviced."),
    (11, "joint_elasticity", "Joint elasticity",
     "The transmission twists under load like a spring, so link and motor angle differ and resonate.",
     "Model the joint with its stiffness, and keep control bandwidth and motions below the resonance."),
    (12, "transmission_hysteresis", "Transmission hysteresis",
     "The transmission's twist depends on the load's history and traces a loop at any speed.",
     "Add a hysteresis state to the transmission, or approach targets always from one side."),
    (13, "reflected_inertia", "Reflected rotor inertia",
     "The rotor's inertia seen through the gear differs from the model, which shows during acceleration.",
     "Correct the joint's armature in the model; check gear ratio and rotor inertia of the drive."),
    (14, "actuator_gain", "Actuator torque gain",
     "The drive delivers a fixed fraction more or less torque than it is told.",
     "Scale the torque constant in the model or recalibrate the drive; it acts on gravity compensation too."),
    (15, "torque_saturation", "Torque saturation",
     "The drive cannot exceed a torque that is lower than the model's limit, so fast moves are flattened.",
     "Set the model's effort limit to the fitted value, or slow the motion; check supply and drive limits."),
    (16, "torque_rate_limit", "Torque rate limit",
     "The drive changes its torque only so fast, so steps turn into ramps.",
     "Add the rate limit to the model, and smooth the commands so that they stay below it."),
    (17, "command_low_pass", "Low-pass filter on the command",
     "A filter between command and drive smooths and delays fast changes.",
     "Find the filter in controller or drive and model it with its cut-off, or raise the cut-off."),
    (18, "command_delay", "Command delay",
     "The command takes effect later than the model believes, by a fixed time.",
     "Add the delay to the model or shorten the chain (bus cycle, buffers, middleware); lower gains if it "
     "cannot be helped."),
    (19, "packet_jitter", "Late or lost command packets",
     "Some commands arrive late or never, and the last one is held meanwhile.",
     "Check network, real-time priority and bus load; train or tune with the fitted rate of lost packets."),
    (20, "controller_gain", "Controller gain",
     "The controller runs with other stiffness or damping than described.",
     "Compare the gains on the machine with the description and correct whichever is wrong."),
    (21, "encoder_offset", "Encoder offset",
     "The joint's zero is off by a constant angle: it believes it stands where it does not.",
     "Recalibrate the joint's zero; confirm with an outside measurement of the tool's position."),
    (22, "encoder_eccentricity", "Encoder eccentricity",
     "The encoder disc is off centre, so the reading errs periodically, once per turn.",
     "Add the periodic correction to the reading or have the encoder aligned."),
    (23, "torque_sensor_error", "Torque sensor error",
     "The torque reading has a wrong zero or a wrong scale.",
     "Zero the sensor in an unloaded pose and check its scale with a known load."),
    # body, mounting, payload
    (24, "payload", "Payload",
     "The mass at the flange, or where it is centred, differs from what the model carries.",
     "Weigh the tool and enter mass and centre of mass; look for forgotten adapters or cables."),
    (25, "link_inertia", "Link inertia",
     "A link's mass, centre of mass or inertia differs from the model.",
     "Correct the link's inertial values in the model, and look for parts mounted on the link."),
    (26, "base_tilt", "Tilt of the base",
     "The arm stands at an angle, so gravity pulls in another direction than the model thinks.",
     "Level the base, or set gravity's direction in model and controller to the fitted one."),
    (27, "mount_compliance", "Compliant mount",
     "Table or stand gives way and swings when the arm accelerates.",
     "Stiffen or bolt the stand; otherwise model it as a spring and damper and avoid its frequency."),
    (28, "cable", "Cable or hose",
     "A cable or hose pulls on the joint like a spring, with some hysteresis.",
     "Reroute or fasten it with slack; if it must stay, add its stiffness to the joint."),
    (29, "kinematic_error", "Kinematic error",
     "Link lengths or joint axes differ from the model, so the tool misses while every joint is on target.",
     "Calibrate the arm's geometry with an outside measurement over many poses."),
    (30, "base_to_base", "Transform between the bases",
     "The two arms do not stand to each other as the model says.",
     "Measure the transform again, with touch points or with the camera from several poses."),
    # contact and objects
    (31, "contact_friction", "Contact friction",
     "Touching surfaces slip earlier or later than the model thinks.",
     "Set the friction coefficient of this pair of materials, measured at several normal forces."),
    (32, "contact_stiffness", "Contact stiffness",
     "Contact is softer or harder than modelled, so force rises and rebounds differently.",
     "Set the stiffness and damping of this pair, measured with taps at several speeds."),
    (33, "clearance", "Clearance of the fit",
     "Hole and peg leave more or less room than the model.",
     "Measure both parts and correct the geometry; wear makes it grow."),
    (34, "grip_slip", "Slip in the grip",
     "The held object moves between the fingers under load.",
     "Raise the gripping force or roughen the fingers; otherwise let the model allow the slip."),
    (35, "tool_compliance", "Compliant tool",
     "The tool bends under load, so that its tip lags behind the flange.",
     "Stiffen the tool, or model it as a spring of the fitted stiffness."),
    (36, "object_mass", "Mass of the object",
     "The handled object weighs, or is balanced, otherwise than modelled.",
     "Weigh the object and correct its mass and centre of mass."),
    (37, "thread_stiffness", "Stiffness of the thread",
     "The thread stretches or bends otherwise than modelled.",
     "Set its stretch and bending stiffness from a hanging and a pulling test."),
    (38, "eye_friction", "Friction at the eye",
     "The thread drags at the needle's eye, or air moves it.",
     "Measure the drag by slow insertion, and shield the scene from draught."),
    # camera and timing
    (39, "hand_eye", "Hand-eye calibration",
     "The camera does not sit on the flange where the model says.",
     "Repeat the hand-eye calibration with at least ten varied poses, and check the camera's screws."),
    (40, "intrinsics", "Camera intrinsics",
     "Focal length or image centre differ from the calibration.",
     "Calibrate the camera again at the resolution that is in use."),
    (41, "lens_distortion", "Lens distortion",
     "Straight lines bend towards the image's edge more or less than calibrated.",
     "Calibrate the distortion with targets that reach the image's corners."),
    (42, "depth_scale", "Depth scale",
     "Depth readings are off by a factor or an offset.",
     "Calibrate depth on a plane at three or more known distances."),
    (43, "depth_noise", "Depth noise",
     "Depth scatters more or less than the model's noise.",
     "Set the noise level in the model, and check lighting and the camera's projector."),
    (44, "depth_dropout", "Missing depth",
     "Pixels lose their depth at edges, slopes and shiny surfaces otherwise than modelled.",
     "Model the dropout over angle and material, or change view or surface."),
    (45, "camera_latency", "Camera latency",
     "Images are older than their stamps say.",
     "Correct the stamps by the fitted time, or use the camera's hardware clock."),
    (46, "clock_offset", "Clock offset or drift",
     "Two devices' clocks disagree, and more so with time.",
     "Synchronise the clocks (PTP, NTP) or correct the stamps when reading."),
    (47, "rolling_shutter", "Rolling shutter or motion blur",
     "Rows are exposed one after another or for long, so that fast views shear or smear.",
     "Shorten the exposure, move slower while looking, or model the row time."),
    (48, "lighting", "Lighting and exposure",
     "The scene's brightness or colour differs from the model.",
     "Fix exposure and white balance, and shield or model the light."),
    (49, "object_geometry", "Geometry of the object",
     "The object's shape or size differs from its mesh.",
     "Measure or scan the object and correct its mesh; check the segmentation at its edges."),
)  # fmt: skip

FAMILIES: dict[str, Family] = {row[1]: Family(*row) for row in _ROWS}


def family(name: str) -> Family:
    """The family of that name.

    Raises:
        InputError: the catalogue has no such family.
    """
    if name not in FAMILIES:
        raise InputError(f"unknown family of effects {name!r}; known are {', '.join(FAMILIES)}")
    return FAMILIES[name]
