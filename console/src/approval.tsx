// A proposed mission: what would fly, what its rehearsal showed, and the decision of a person.

import "./approval.css";
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { answered, ask, messageOf, usePolled } from "./connection";
import { type Flight, useFlight } from "./flight";
import { FlightMap } from "./map";
import { Page, Silence } from "./page";
import { type LeasedArea, type Point, robotsOf } from "./place";
import { type PlannedWay, boxAround, heightsOf, placesOn, plannedWays, shownOf } from "./planned";
import { HeightProfile, PlannedLayer } from "./planned_map";
import { PreflightPanel } from "./preflight";
import { useScenery } from "./scenery";
import type { Sight } from "./sight";
import { LiveSource } from "./source";
import { Corners, round } from "./survey";
import { Badge, Button, Card, Field, Figure, type FigureProps, useEscape } from "./widgets";
import { clock, wordsOf } from "./words";
import type { AccountOut, ApprovalIn, Envelope, FleetOut, MissionOut, ProposalOut, RobotConfig } from "./wire";

/** Milliseconds between two requests of the proposal. */
const PAUSE = 1000;
/** Metres around the ways in the area that is suggested for changes. */
const MARGIN = 5;
/** Share of the charge above the reserve below which what is left is shown as little. */
const LITTLE = 0.1;
const LEGEND = { stop: "waypoint", planned: "planned", rehearsed: "rehearsed", nearest: "nearest to a thing" };

interface ApprovalProps {
  first: MissionOut;
  account: AccountOut;
  fleet: FleetOut;
  areas: LeasedArea[];
  title: ComponentChildren;
  onMission(id: string): void;
  /** What is shown of a mission that was not proposed. */
  children: ComponentChildren;
}

/** The page of a mission that was proposed and has not flown yet. */
export function ApprovalPage(props: ApprovalProps) {
  const { first, account, title } = props;
  const path = `v1/missions/${first.id}`;
  const { answer } = usePolled(
    path,
    (signal) => ask<MissionOut>(path, undefined, signal),
    (newest) => (newest && !newest.proposal ? null : PAUSE),
  );
  const flight = useFlight(first.id, [first], () => new LiveSource(first.id));
  /** Hash of what was first shown to be decided about. */
  const opened = useRef<string | null>(null);
  if (!flight || !answer) return null;
  const { proposal, phase } = answer;
  if (!proposal) return <>{props.children}</>;
  const waits = phase === "awaiting_approval";
  if (waits) opened.current ??= proposal.hash;
  return (
    <Page title={title} who={`${account.name}, ${account.role}`} flight={flight}>
      <Silence flight={flight} unreachable="" />
      {waits && proposal.hash !== opened.current && (
        <p class="banner bad" role="alert" data-testid="changed">
          The proposal or its rehearsal has changed since you opened it: read it again.
        </p>
      )}
      {/* What was ticked for one is not for another. */}
      <Review key={proposal.hash} {...props} {...{ flight, proposal }} mission={answer} />
    </Page>
  );
}

type ReviewProps = Omit<ApprovalProps, "children"> & { flight: Flight; mission: MissionOut; proposal: ProposalOut };

function Review({ flight, mission, proposal, account, fleet, areas, onMission }: ReviewProps) {
  const { verdict } = mission;
  const scenery = useScenery(`v1/missions/${mission.id}/scenery`);
  const [envelope, setEnvelope] = useState<Envelope | null>(null);
  const [ticked, setTicked] = useState<string[]>([]);
  const robots = useMemo(() => robotsOf(fleet).filter(({ id }) => mission.robots.includes(id)), []);
  const ways = useMemo(() => plannedWays(mission, fleet, robots), []);
  const points = useMemo(() => shownOf(ways, robots), []);
  const clearance = verdict?.clearance ?? null;
  const fences = robots.map(({ limits }) => limits.geofence);
  const ceiling = Math.min(...fences.map((one) => one.ceiling));
  const floor = Math.max(...fences.map((one) => one.floor), 0);
  const objection = flight.stale ? "The service is silent." : objectionTo(account, mission);
  const waits = mission.phase === "awaiting_approval";
  const drawn = waits && envelope ? areaOf(envelope, setEnvelope) : null;
  const planned = {
    ...{ points, drawn, legend: LEGEND },
    draw: (sight: Sight) => <PlannedLayer {...{ ways, clearance, sight }} />,
  };
  const moment = proposal.approval?.lapses ?? proposal.lapses;
  const body = { hash: proposal.hash, envelope, actuators: ticked };
  return (
    <>
      <main class="panels approval">
        <div class="wide">
          <FlightMap {...{ flight, robots, scenery, areas, planned }} chosen={null} />
          <Card kind="heights" label="Height profile" head={<span class="hint">metres above home</span>}>
            <HeightProfile {...{ ways, clearance, ceiling, floor }} />
          </Card>
        </div>
        <div class="side">
          <Request mission={mission} proposal={proposal} />
          <Rehearsal {...{ mission, ways, fleet, robots }} />
          {waits && !objection && (
            <Card kind="terms" label="Terms of the approval">
              {proposal.actuators.map((name) => (
                <Tick
                  key={name}
                  name={name}
                  on={ticked.includes(name)}
                  onChange={(on) => setTicked(on ? [...ticked, name] : ticked.filter((one) => one !== name))}
                >
                  It may move <strong>{name}</strong>
                </Tick>
              ))}
              <Tick
                name="envelope"
                on={envelope !== null}
                onChange={(on) => setEnvelope(on ? suggested(ways, proposal, ceiling, floor) : null)}
              >
                Its way may be changed in flight, within an area
              </Tick>
              {envelope && (
                <div class="envelope" data-testid="envelope">
                  <p class="hint">Drag the corners on the map, or click to add more; Backspace removes the last one.</p>
                  {ENVELOPE.map(([field, label]) => (
                    <Field
                      key={field}
                      name={field}
                      label={label}
                      value={String(envelope[field])}
                      onValue={(value) => setEnvelope({ ...envelope, [field]: Number(value) })}
                    />
                  ))}
                  {drawn && <Corners drawn={drawn} />}
                </div>
              )}
            </Card>
          )}
          <Waypoints ways={ways} />
          {mission.robots.map((robot) => (
            <PreflightPanel key={robot} robot={robot} title={`${robot} now`} live={!flight.over} open={false} />
          ))}
        </div>
      </main>
      <Decision
        {...{ mission, account, objection, body, onMission }}
        proposal={proposal}
        left={moment === null ? null : flight.clock.until(1e9 * moment) / 1000}
      />
    </>
  );
}

function Tick(props: { name: string; on: boolean; onChange(on: boolean): void; children: ComponentChildren }) {
  const { name, on, onChange, children } = props;
  return (
    <label class="check">
      <input type="checkbox" name={name} checked={on} onChange={(event) => onChange(event.currentTarget.checked)} />
      <span>{children}</span>
    </label>
  );
}

/** Who asks for what, in words. */
function Request({ mission, proposal }: { mission: MissionOut; proposal: ProposalOut }) {
  const { summary, difference, records, hash, why } = proposal;
  return (
    <Card kind="request" label="Request" title={mission.name} head={<Phase mission={mission} />}>
      <p class="hint">
        Asked for by <strong>{mission.account}</strong> of {mission.tenant}, {at(mission.submitted)} ·{" "}
        <abbr title={`SHA-256 ${hash}`} data-testid="hash">{hash.slice(0, 12)}</abbr>
      </p>
      {why && (
        <figure class="unchecked" data-testid="why">
          <figcaption>The proposer's own words: nobody has checked them</figcaption>
          <blockquote><bdi>{why}</bdi></blockquote>
        </figure>
      )}
      <Lines title="What would fly" lines={summary} none="No summary." testid="summary" />
      <Lines
        title="Difference to what was approved before"
        lines={difference}
        none="It is the first of its name."
        testid="difference"
      />
      <Lines
        title="What it records of people and places"
        lines={records}
        none="Nothing: it runs no camera."
        tone="warn"
        testid="records"
      />
    </Card>
  );
}

function Phase({ mission }: { mission: MissionOut }) {
  const tone = { awaiting_approval: "warn", refused: "bad", failed: "bad", cancelled: "bad" }[mission.phase as string];
  return <Badge tone={tone ?? ""} testid="phase" status>{wordsOf(mission.phase)}</Badge>;
}

interface LinesProps {
  title: string;
  lines: string[];
  none: string;
  tone?: string;
  testid: string;
}

function Lines({ title, lines, none, tone = "", testid }: LinesProps) {
  return (
    <div class={`lines ${lines.length > 0 ? tone : ""}`} data-testid={testid}>
      <h3>{title}</h3>
      {lines.length > 0 ? (
        <ul>
          {lines.map((line) => (
            <li key={line}><bdi>{line}</bdi></li>
          ))}
        </ul>
      ) : (
        <p class="hint">{none}</p>
      )}
    </div>
  );
}

interface RehearsalProps {
  mission: MissionOut;
  ways: PlannedWay[];
  fleet: FleetOut;
  robots: RobotConfig[];
}

/** Figures, reasons and picture of the rehearsal. */
function Rehearsal({ mission: { verdict, proposal }, ways, fleet, robots }: RehearsalProps) {
  const picture = usePicture(verdict?.picture ?? null, proposal?.hash ?? "");
  if (!verdict || !proposal) {
    return <Card kind="" label="Rehearsal"><p class="empty">Not rehearsed yet.</p></Card>;
  }
  const { distance, seconds, battery_used, clearance, seeds, reasons, approved } = verdict;
  // Of several drones, only the sum of what they use is known.
  const [only, ...others] = fleet.robots.filter(({ id }) => robots.some((one) => one.id === id));
  const charge = others.length > 0 ? null : (only?.battery ?? null);
  const left = charge === null || battery_used === null ? null : charge - battery_used;
  const reserve = robots[0]?.limits.battery_land ?? 0;
  const figures: FigureProps[] = [
    { name: "Way", value: distance?.toFixed(0), unit: "m" },
    { name: "Time", value: seconds === null ? null : clock(seconds), unit: `of ${proposal.minutes} min` },
    { name: "Highest", value: heightsOf(ways)[1].toFixed(1), unit: "m" },
    { name: "Charge used", value: percent(battery_used), unit: others.length > 0 ? "in all" : "" },
    {
      ...{ name: "Charge left", value: percent(left), unit: `reserve ${percent(reserve)}` },
      tone: left !== null && left < reserve + LITTLE ? "bad" : "",
    },
    {
      ...{ name: "Nearest thing", value: clearance?.distance.toFixed(1) ?? "none" },
      unit: clearance ? `m, ${wordsOf(clearance.label)} ${clearance.thing}` : "",
      tone: clearance && clearance.distance < 1 ? "bad" : "",
      title: clearance ? `${clearance.robot} at ${clearance.place.map((one) => one.toFixed(1)).join(", ")}` : "",
    },
    {
      ...{ name: "Simulated", value: String(Math.max(1, seeds.length)) },
      unit: seeds.length > 1 ? "flights" : "flight",
      title: `seeds ${seeds.join(", ")}`,
    },
  ];
  const head = <Badge tone={approved ? "good" : "bad"}>{approved ? "good" : "refused"}</Badge>;
  return (
    <Card kind="rehearsal" label="Rehearsal" head={head}>
      <dl class="figures" data-testid="figures">
        {figures.map((figure) => (
          <Figure key={figure.name} {...figure} />
        ))}
      </dl>
      {reasons.map((reason) => (
        <p key={reason} class={approved ? "hint" : "problem"}>{reason}</p>
      ))}
      {picture && <img src={picture} alt="The rehearsed flight from above, with its fence" data-testid="picture" />}
    </Card>
  );
}

/** The waypoints as a table, for who wants figures or does not see the map. */
function Waypoints({ ways }: { ways: PlannedWay[] }) {
  return (
    <Card kind="waylist" label="Waypoints">
      {ways.map(({ robot, tone, stops, ordered, stream }) => (
        <details key={robot} class={tone} open={stops.length > 0 && stops.length <= 8 && ways.length === 1}>
          <summary>
            <span class="swatch" aria-hidden="true" /> {robot}:{" "}
            {stream === null ? `${stops.length} waypoints${ordered ? "" : ", in an order found in flight"}` : (
              <>way decided in flight by <bdi>{stream}</bdi></>
            )}
          </summary>
          {stops.length > 0 && (
            <ol>
              {stops.map(({ id, point, height, doing }) => (
                <li key={id}>
                  <strong><bdi>{id}</bdi></strong>{" "}
                  <small>{point[0].toFixed(1)} E, {point[1].toFixed(1)} N, {height}{doing && ` · ${doing}`}</small>
                </li>
              ))}
            </ol>
          )}
        </details>
      ))}
    </Card>
  );
}

interface DecisionProps {
  mission: MissionOut;
  proposal: ProposalOut;
  account: AccountOut;
  /** Why this account may not approve now; empty if it may. */
  objection: string;
  /** What is approved. */
  body: ApprovalIn & { actuators: string[] };
  /** Seconds for which approval or rehearsal are good; null without one. */
  left: number | null;
  onMission(id: string): void;
}

/** The bar of the decision, which stays in sight. */
function Decision({ mission, proposal, account, objection, body, left, onMission }: DecisionProps) {
  const [asked, setAsked] = useState<"approve" | "refuse" | null>(null);
  const [sending, setSending] = useState(false);
  const [problem, setProblem] = useState("");
  useEscape(asked === null ? null : () => setAsked(null));
  const { actuators, minutes, change_of } = proposal;
  const waits = mission.phase === "awaiting_approval";
  const missing = actuators.filter((one) => !body.actuators.includes(one));
  const cornered = body.envelope && body.envelope.area.length < 3 ? "The area of the changes needs three corners." : "";
  const lacking = missing.length > 0 ? `Tick under “Terms” that it may move ${missing.join(", ")}.` : cornered;
  const mayRefuse = waits && account.role !== "viewer" && account.scopes.includes("fly");
  const path = `v1/missions/${mission.id}`;
  const decide = async (choice: "approve" | "refuse") => {
    setSending(true);
    setProblem("");
    const answer = choice === "approve" ? ask(`${path}/approve`, body) : answered(path, undefined, undefined, "DELETE");
    await answer.catch((error: unknown) => setProblem(messageOf(error)));
    setSending(false);
    setAsked(null);
  };
  const who = mission.robots.join(" and ");
  const question = {
    approve: change_of ? `Let ${who} change its way now?` : `Let ${who} fly for up to ${minutes} minutes?`,
    refuse: "Refuse it? Its proposer has to propose anew.",
  };
  return (
    <section class="card decision" aria-label="Decision">
      {waits && asked ? (
        <Sure
          text={question[asked]}
          word={WORDS[asked]}
          sending={sending}
          onCancel={() => setAsked(null)}
          onSure={() => void decide(asked)}
        />
      ) : (
        <>
          <p role="status" data-testid="now">{nowOf(mission, objection || lacking, left)}</p>
          <div class="buttons">
            {waits && !objection && (
              <Button class="primary approve" disabled={lacking !== ""} onClick={() => setAsked("approve")}>
                Approve…
              </Button>
            )}
            {mayRefuse && <Button class="refuse" onClick={() => setAsked("refuse")}>Refuse…</Button>}
            {mission.phase === "applied" && change_of && (
              <Button class="primary" onClick={() => onMission(change_of)}>Open its flight</Button>
            )}
          </div>
        </>
      )}
      {problem && <p class="problem" role="alert" data-testid="refusal">{problem}</p>}
    </section>
  );
}

const ENVELOPE = [
  ["floor", "Lowest, m"],
  ["ceiling", "Highest, m"],
  ["minutes", "Minutes from take-off"],
] as const;
const WORDS = { approve: "Yes, approve", refuse: "Yes, refuse" };

interface SureProps {
  text: string;
  word: string;
  sending: boolean;
  onSure(): void;
  onCancel(): void;
}

/** The question before a decision; its answer has the focus. */
function Sure({ text, word, sending, onSure, onCancel }: SureProps) {
  const group = useRef<HTMLDivElement>(null);
  useEffect(() => group.current?.querySelector("button")?.focus(), []);
  return (
    <>
      <p><strong>{text}</strong></p>
      <div class="buttons" role="group" aria-label={text} ref={group} data-testid="sure">
        <Button onClick={onCancel}>Cancel</Button>
        <Button class="primary" disabled={sending} onClick={onSure}>{word}</Button>
      </div>
    </>
  );
}

/** What the mission waits for, and for how long that is good. */
function nowOf({ phase, reason, proposal }: MissionOut, objection: string, left: number | null): string {
  const good = left === null ? "" : left > 0 ? ` is good for ${clock(left)} min.` : " has lapsed.";
  if (phase === "awaiting_approval") return objection || `Approve only what you have read here. Its rehearsal${good}`;
  const approval = proposal?.approval;
  if (approval && phase === "queued") return `Approved by ${approval.account}; the approval${good} ${reason}`;
  return reason ? `${wordsOf(phase)}: ${reason}` : wordsOf(phase);
}

/** Why an account may not approve a mission; the service checks the same. */
function objectionTo(account: AccountOut, mission: MissionOut): string {
  if (account.scopes.includes("propose")) return "An agent's account approves nothing.";
  if (account.role !== "operator" && account.role !== "admin") return "An operator decides about it.";
  return account.name === mission.account ? "Another account than its proposer's decides about it." : "";
}

/** The envelope that is suggested: around the ways, within the fence's heights. */
function suggested(ways: PlannedWay[], { minutes }: ProposalOut, ceiling: number, floor: number): Envelope {
  const [west, ...others] = boxAround(placesOn(ways), MARGIN).map(pairOf);
  const area = [west, ...others] as Envelope["area"];
  return { area, floor, minutes, ceiling: Math.min(ceiling, Math.ceil(heightsOf(ways)[1] + 1)) };
}

function pairOf(point: Point): [number, number] {
  const [east, north] = round(point);
  return [east, north];
}

/** The envelope's area as the map draws and changes it. */
function areaOf(envelope: Envelope, set: (envelope: Envelope) => void) {
  const change = (area: Point[]) => set({ ...envelope, area: area.map(pairOf) as Envelope["area"] });
  const { area } = envelope;
  return {
    ...{ area, path: [], photos: [], refused: area.length < 3 },
    add: (point: Point) => change([...area, point]),
    move: (corner: number, to: Point) => change(area.map((one, place) => (place === corner ? to : one))),
    undo: () => change(area.slice(0, -1)),
    cancel: () => undefined,
  };
}

/** Address of a picture that needs the token, anew for another `version`; null while there is none. */
function usePicture(path: string | null, version: string): string | null {
  const [address, setAddress] = useState<string | null>(null);
  useEffect(() => {
    if (path === null) return;
    let [gone, made] = [false, ""];
    answered(path.replace(/^\//, ""))
      .then((answer) => answer.blob())
      .then((picture) => {
        if (gone) return;
        made = URL.createObjectURL(picture);
        setAddress(made);
      })
      // The figures stand without it.
      .catch(() => undefined);
    return () => {
      gone = true;
      URL.revokeObjectURL(made);
      setAddress(null);
    };
  }, [path, version]);
  return address;
}

function percent(share: number | null): string | null {
  return share === null ? null : `${(100 * share).toFixed(0)} %`;
}

function at(seconds: number): string {
  return new Date(1000 * seconds).toLocaleTimeString();
}
