"""Compares the output of exported scripts with what the double did.

`sentences` lists every text in a script's source that a person may read, and `TRUE` contains a claim about the
record of a flight for each text. The test fails for a text without a claim, and for a claim without its text. After
each flight, every text that was printed has to be true of the flight.
"""

import ast
import json
import re

CUT, WATCHDOG, LANDING = "the firmware's own cut", "the firmware's watchdog", "the end of a landing"


def sentences(source):
    """Returns texts of two or more words, with `…` for inserted values, except documentation and help."""
    tree, passed = ast.parse(re.sub(r"@[A-Z]+@", "None", source)), set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr):
            passed.add(id(body[0].value))
        if isinstance(node, ast.JoinedStr):
            passed |= {id(part) for part in node.values}
        name = isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", ""))
        if name in ("add_argument", "ArgumentParser", "error"):
            passed |= {id(part) for part in ast.walk(node)}
    listed = set()
    for node in ast.walk(tree):
        if id(node) in passed:
            continue
        if isinstance(node, ast.JoinedStr):
            text = "".join(part.value if isinstance(part, ast.Constant) else "…" for part in node.values)
        else:
            text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
        if re.search(r"[a-z]{2,}\W* ", text.strip()):
            listed.add(text)
    return listed


def stayed(d, before):
    return d.body.top_m < 0.05


def always(d, before):
    return True


def was_lost(d, before):
    """True if a link fell silent or was abandoned, a call failed, or the disk was full."""
    return d.is_dead_s is not None


def something_failed(d, before):
    return was_lost(d, before) or d.failed


def has_fault(d, before):
    """True if the firmware has stopped the motors."""
    return d.body.locked and d.body.cut_by in (CUT, WATCHDOG) or any(radio.bits for radio in d.radios)


def reads(test, *names):
    return lambda d, before: any(test(radio.read(name), d.script.LIMITS) for radio in d.radios for name in names)


def falls(d, before):
    """True if the firmware stopped the motors, or the drone never left the floor."""
    return d.body.cut_by == CUT or d.body.top_m < 0.05


def heard_landing(d):
    return bool(d.body.landings) and (d.body.took_over or d.mode == "trajectory")


def conditions(d, before):
    """True if the conditions before a sentence are not met, so that the sentence claims nothing."""
    end = before[before.rfind("if "):] if before.endswith(", ") else ""
    return "taken off" in end and stayed(d, "") or "not received the landing" in end and heard_landing(d)


def levels_and_falls(d, before):
    return conditions(d, before) or d.body.leveled and d.body.cut_by == WATCHDOG


def flies_to_its_end(d, before):
    return conditions(d, before) or (
        d.body.cut_by == WATCHDOG and d.body.locked and d.outcome == "landed")


def lands_by_itself(d, before):
    return d.body.cut_by == LANDING and d.outcome == "landed"


def is_off(d, before):
    return not d.body.on


def is_whole(d, before):
    """True if the named log is complete."""
    with open(d.log_named, encoding="utf-8") as file:
        return json.load(file)["noctograph"]["word"] == d.script.DATA["word"]


def written(d, before):
    """True if the whole word was sent, or flown on board."""
    data = d.script.DATA["trajectory"] if d.mode == "trajectory" else d.script.DATA
    return d.lights_sent >= len(data["lights"]) - 1


# Texts of tables, questions and advice before the start, when the drone is on the floor.
FLOOR = """the trajectory could not be uploaded|this drone has no LED-ring deck|the lights could not be uploaded|
parameters could not be set|no answer|… or newer|clock on board|measured at take-off|known or measured|
deck for …|names in the firmware|without …|… … instead of …| and … more|as checked|as checked, or --set-gains|no log data: …|
log data of the drone|can fly|cannot fly|position known within|nose, left of x|roll, pitch|up to …°|
a larger battery|battery at rest|…: …, wanted …|the drone does not arm|the firmware has no …|
the drone reports no position|… is not a position: wanted three numbers in meters|x measured (wanted)|
error: cflib … or newer is needed: pip install cflib|: plug the radio in, and close other programs that use it|
error: cflib … is too old, … or newer is needed: pip install --upgrade cflib|no link to …: ……|
the parameters of … could not be read|error: keys cannot be pressed here: start the script in a terminal|
another drone did not start|the drone has not taken off|heading on board|
update the firmware with cfclient, or fly --mode position or full-state|
export for this drone: --scene cf21 or cf-brushless|update it with cfclient|carry the drone to the start of the plan|turn the drone|
install the firmware release for which this script was exported|set the drone upright, and switch it off and on again|put the drone on level ground|
export with the drone's gains, or fly with --set-gains, which restores them later|
is the positioning system on, and is its geometry on the drone?|is the radio too far away?|
charge it, because the flight would drain it below the firmware's low-battery voltage|
the geometry is off by more than … cm: estimate it again, with the origin in the middle of the room's floor|
Corner … of 4: hold the drone at (…) m, with the nose as in the flight, and press Enter, or type its actual position as x, y, z: |
The flight was checked without a room. The origin is that of the positioning system.|
The flight was checked in a room of … x … x … m. The origin of the positioning system must be the middle of the floor, … m from the left and right walls and … m from the front and back walls, with x to the right of the photographer.|
Is this correct, is the shutter ready, and is everyone behind the net? Press Enter to take off, or Ctrl-C to exit. |
Is this correct, and are … drones ready? Press Enter to take off, or Ctrl-C to exit. """

# Prefixes, names of attempted actions, and headings, which are true if the text after them is.
PARTS = """restoring …|waiting for the restored parameters|ending a log block|writing the log|writing the log to another folder|the disk hangs|
stopping the motors|handing over|opening a new link|querying the drone|a closed window|if …, |it has taken off|it has not received the landing command|
error: …|another drone"""

TRUE = {
    "stopped by Ctrl-C": lambda d, before: d.pressed,
    "stopped by …": lambda d, before: d.pressed,
    "the radio link was lost": was_lost,
    "the drone does not respond. …": was_lost,
    "no new link within … s: …": was_lost,
    "… failed: …": something_failed,
    "the log of this flight is lost": lambda d, before: d.log_named is None,
    "log: …": is_whole,
    "the samples could not be stored during the flight: …": lambda d, before: d.failed,
    "the firmware has stopped the motors, ……": has_fault,
    "the firmware stopped the motors, …": has_fault,
    ": it falls": falls,
    "the drone does not send log data: ": lambda d, before: was_lost(d, "") or any(
        not block.on for radio in d.radios for block in radio.blocks),
    "the drone reports a value that is not a number": lambda d, before: any(
        value != value for radio in d.radios for value in radio.values.values()),
    "the battery is empty": reads(lambda volts, limits: volts < limits["critical_v"], "pm.vbat"),
    "the battery is low": reads(lambda volts, limits: volts < limits["low_v"], "pm.vbat"),
    "the position is lost": reads(lambda variance, limits: not variance <= limits["lost_m2"],
                                  "kalman.varPX", "kalman.varPY", "kalman.varPZ"),
    "the drone is outside its fence": lambda d, before: any(map(any, (radio.drift for radio in d.radios))),
    "the drone is far from its target": lambda d, before: any(map(any, (radio.drift for radio in d.radios))),
    "the clock on board could not be measured: no targets in the log": something_failed,
    "the clock on board runs at … of true time, unlike that of any known firmware": lambda d, before: min(
        abs(d.body.clock_rate - rate) for rate in (1.0, 84 / 85)) > 0.003,
    "the word is written": written,
    "no flight was started: the drone is on the floor, and may be armed. If its propellers turn, the firmware stops them after 30 s. Switch the drone off before you touch it": stayed,
    "reconnected to the drone, which lands": lambda d, before: (
        bool(d.body.landings) and not d.outcome.startswith("falls")),
    "the firmware levels the drone out after 0.5 s and stops its motors after 2 s, so that it falls": levels_and_falls,
    "the drone flies to the end of its trajectory, hovers for 3 s and lands by itself, and 2 s later the firmware "
    "stops its motors and locks it": flies_to_its_end,
    "Stay behind the net until the propellers stand still. If they do not stop, wait until the battery is empty": was_lost,
    "motors stopped": is_off,
    "the drone does not respond, and may not have received the command to stop its motors. …": was_lost,
    "the link was lost during the landing: the drone has received the landing command, and lands by itself. …": lands_by_itself,
    "after three landing commands, the drone still reports a height of … m: motors stopped": is_off,
    "there is a new link, but the drone sends no state. …": was_lost,
    ": it has fallen": lambda d, before: d.body.fell_m > 0.05 and d.body.cut_by == WATCHDOG,
    "reconnected: the firmware has stopped its motors, ……": lambda d, before: (
        d.body.locked and not d.body.on),
    "reconnected: the drone does not fly, and its motors are off": is_off,
    "Landed. Close the shutter, and press Enter to restore the lamps. ": lambda d, before: (
        d.outcome == "landed" and d.down_at_prompt),
    "another drone ended early": lambda d, before: d.another_ended,
    **dict.fromkeys(FLOOR.replace("|\n", "|").split("|"), stayed),
    **dict.fromkeys(PARTS.replace("|\n", "|").split("|"), always),
}


def pattern(text):
    return re.compile(".+?".join(map(re.escape, text.split("…"))), re.S)


# Longer sentences come first, because they contain shorter ones.
PATTERNS = [(text, pattern(text), TRUE[text]) for text in sorted(TRUE, key=len, reverse=True)
            if TRUE[text] is not always and text not in FLOOR.replace("|\n", "|").split("|")]


def untrue(said, d):
    """Returns the sentences in the output about a drone that are not true."""
    wrong = []
    for text, regex, claim in PATTERNS:
        for match in list(regex.finditer(said)):
            if not claim(d, said[:match.start()]):
                wrong.append(text)
            if len(text) > 20 and "…" not in text:
                said = said[:match.start()] + "." * len(match[0]) + said[match.end():]
    return wrong


def swarm_stayed(ros, names):
    return not any(ros.drones[name].flew for name in names)


def swarm_reads(attribute, *values):
    return lambda ros, names: any(getattr(ros.drones[name], attribute) != value
                                  for name in names for value in values)


def swarm_lands_alone(ros, names):
    """True if the drone flies to the end of its trajectory and lands by itself, or has received the landing."""
    return all(ros.drones[name].outcome() in ("landed", "never took off") for name in names)


# Claims for the script of Crazyswarm2, about the double of its server and the drones that are named
# in a line.
SWARM = {
    "; if the drone took off and receives no command, it flies to the end and lands by itself: stay behind the net until its "
    "propellers stand still": swarm_lands_alone,
    "…: no … topic for … s": swarm_reads("silent", ()),
    "…: …: the firmware has stopped its motors": lambda ros, names: all(ros.drones[n].info & 2272 for n in names),
    ", it falls": lambda ros, names: all(ros.drones[n].cut_by == "the firmware" or not ros.drones[n].started
                                         for n in names),
    "the battery is empty": swarm_reads("battery_v", 4.1),
    "the position is lost": swarm_reads("sigma_m", 0.002),
    "outside the checked volume": swarm_reads("carried", None),
    "…: it may be in the air, so it is not disarmed: stay behind the net until its propellers stand still":
        lambda ros, names: not any(ros.drones[n].cut_by == "disarming" for n in names),
    "…: armed, but it cannot fly": swarm_stayed,
    "the drones keep the controller and the gains of this flight until they restart": lambda ros, names: bool(
        ros.of("setParam")),
    "landing; press Ctrl-C again to stop the motors": lambda ros, names: ros.pressed and bool(ros.of("land")),
    "motors stopped": lambda ros, names: bool(ros.of("emergency")),
    "stopped by Ctrl-C or another signal": lambda ros, names: ros.pressed,
    **dict.fromkeys("""warning: …: …|a deck has a fault|can fly|supervisor …|can fly or be armed|battery at rest|
position settled|the server has no …: start it with the crazyflies.yaml beside this script|…: its firmware has no …|
…: no … or status topic: start the server with the crazyflies.yaml beside this script|…………wanted: …|
…: … is …, wanted …|check by eye that the drones are …, carry the lamps of the plan, and stand in a frame with the middle of the room at x = y = 0|, a room of … m|wanted a release such as 2026.08|
Is the shutter ready, and is everyone behind the net? Press Enter to take off, or Ctrl-C to exit. |error: …""".replace("|\n", "|").split("|"),
                    always),
}


def untrue_of_swarm(said, ros):
    """Returns the sentences in the output of Crazyswarm2's script that are not true of what the double did."""
    wrong = []
    for text, claim in SWARM.items():
        for line in said.splitlines() if claim is not always else ():
            names = [name for name in ros.drones if f"{name}:" in line] or list(ros.drones)
            if pattern(text).search(line) and not claim(ros, names):
                wrong.append(text)
    return wrong
