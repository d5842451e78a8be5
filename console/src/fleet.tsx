// The first page of a provider: all drones on one map and in one table, their alerts and missions, and
// commands for several drones at once.

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import "./fleet.css";
import { Refused, ask } from "./connection";
import { useEscape } from "./escape";
import { AlertLog, type ClockOffset, NAMES, SEEN, type Word, aheadOf, ending, shifted } from "./flight";
import { NewestAlert } from "./flight_bar";
import { MapView, PlaceLayer } from "./map";
import { Drone, Plan, Way } from "./map_layers";
import { Alerts, tone } from "./panels";
import { type Place, type Point, type Spot, areasOf } from "./place";
import { Badge, PreflightPanel } from "./preflight";
import { useScenery } from "./scenery";
import type { AccountOut, Answer, CommandIn, MissionOut, RobotOut, StatusOut } from "./wire";

/** Seconds without a word after which what a flying drone told is shown as old. */
const OLD = 5;
/** Pixels around a drone on the map within which a click chooses it. */
const NEAR = 30;
const TRAIL = 600;
/** Milliseconds within which a command for several drones is confirmed by a second click. */
const SURE = 4000;
const WAITING = new Set(["submitted", "rehearsing", "awaiting_approval", "queued"]);
const LINKS: Record<RobotOut["link"], string> = {
  unwatched: "not watched",
  connecting: "connecting",
  connected: "connected",
  mission: "up",
  lost: "lost",
};

interface FleetProps {
  account: AccountOut;
  place: Place;
  robots: RobotOut[];
  missions: MissionOut[];
  clock: ClockOffset;
  /** Whether the server answers. */
  reached: boolean;
  token: string;
  onMission(id: string): void;
}

/** A drone with the mission that flies it, as far as the account sees that. */
interface Row {
  robot: RobotOut;
  mission: MissionOut | undefined;
  status: StatusOut | undefined;
  /** Missions that wait for it. */
  waiting: MissionOut[];
  /** Seconds since it was heard; null if it never was. */
  age: number | null;
}

/** A command that was given to several drones, with each one's answer as it comes. */
interface GroupOrder {
  id: number;
  word: Word;
  robots: string[];
  accepted: Set<string>;
  refused: Map<string, string>;
}

export function Fleet(props: FleetProps) {
  const { account, place, robots, missions, clock, reached, token } = props;
  const [chosen, setChosen] = useState<string | null>(null);
  const [selected, setSelected] = useState<ReadonlySet<string>>(new Set());
  const [orders, setOrders] = useState<GroupOrder[]>([]);
  const [, draw] = useState(0);
  const log = useRef(new AlertLog()).current;
  const trails = useRef(new Map<string, Spot[]>()).current;
  const scenery = useScenery("v1/fleet/scenery", token);
  const areas = useMemo(() => areasOf(robots), [robots]);
  const rows = robots.map((robot) => rowOf(robot, missions, clock));
  // During rendering: what is told now is shown now.
  useMemo(() => {
    for (const one of missions) if (one.phase === "flying") log.take(one.alerts, one.name);
    for (const row of rows) {
      const spot = spotOf(row);
      const trail = trails.get(row.robot.id) ?? [];
      if (!row.status) trails.delete(row.robot.id);
      else if (spot && shifted(trail.at(-1), spot)) {
        trails.set(row.robot.id, [...trail, spot].slice(-TRAIL));
      }
    }
  }, [robots, missions]);
  const acknowledge = (id: number | null) => {
    log.acknowledge(id);
    draw((count) => count + 1);
  };

  const commanded = rows.filter((row) => mayCommand(account, row));
  const group = commanded.filter(({ robot }) => selected.size === 0 || selected.has(robot.id));
  const give = (word: Word) => {
    const order: GroupOrder = {
      id: (orders[0]?.id ?? 0) + 1,
      word,
      robots: group.map((row) => row.robot.id),
      accepted: new Set(),
      refused: new Map(),
    };
    setOrders((before) => [order, ...before].slice(0, 20));
    for (const { robot, mission } of group) {
      const body: CommandIn = { robot: robot.id, command: word };
      ask<Answer>(`v1/missions/${mission?.id}/commands`, token, body)
        .then((answer) => {
          if (answer.accepted) order.accepted.add(robot.id);
          else order.refused.set(robot.id, answer.text);
        })
        .catch((error: unknown) => {
          const lost = error instanceof Refused && error.status === 0;
          const text = error instanceof Error ? error.message : String(error);
          order.refused.set(robot.id, lost ? "no answer: look whether it obeys" : text);
        })
        .finally(() => draw((count) => count + 1));
    }
  };
  const select = (id: string) =>
    setSelected((before) => new Set(before.has(id) ? [...before].filter((one) => one !== id) : [...before, id]));
  useEscape(selected.size > 0 ? () => setSelected(new Set()) : null);

  const flying = rows.filter((row) => row.status).length;
  const lost = rows.filter((row) => row.robot.link === "lost").length;
  const focus = rows.find((row) => row.robot.id === chosen);
  return (
    <>
      <section class="card flightbar" aria-label="Fleet">
        <p class="now" data-testid="now">
          <strong>{robots.length} drones</strong>
          <span class="figures">{flying} in flight</span>
          {lost > 0 && <span class="badge bad">{lost} lost</span>}
        </p>
        <div class="newest">
          <NewestAlert log={log} onAcknowledge={acknowledge} />
          {orders[0] && <OrderText order={orders[0]} rows={rows} />}
        </div>
        <GroupCommands
          key={group.map((row) => row.robot.id).join()}
          some={selected.size > 0}
          count={group.length}
          reached={reached}
          onCommand={give}
        />
      </section>
      <main class="panels fleet">
        <div class="wide">
          <FleetMap {...{ rows, areas, place, scenery, trails, token, chosen, reached }} onChoose={setChosen} />
          <Table
            rows={rows}
            commanded={new Set(commanded.map((row) => row.robot.id))}
            {...{ chosen, selected }}
            onChoose={setChosen}
            onSelect={select}
            onMission={props.onMission}
          />
        </div>
        <div class="side">
          <Alerts log={log} recorded={false} onAcknowledge={acknowledge} />
          {focus && <Chosen key={focus.robot.id} row={focus} token={token} onMission={props.onMission} />}
          <Missions missions={missions} onMission={props.onMission} />
          {orders.length > 0 && (
            <section class="card commandlog" aria-label="Commands">
              <h2>Commands</h2>
              <div data-testid="orders">
                {orders.map((order) => (
                  <OrderText key={order.id} order={order} rows={rows} />
                ))}
              </div>
            </section>
          )}
        </div>
      </main>
    </>
  );
}

function rowOf(robot: RobotOut, missions: MissionOut[], clock: ClockOffset): Row {
  const has = (one: MissionOut) => one.attach === null && one.robots.includes(robot.id);
  const mission = missions.find((one) => one.phase === "flying" && has(one));
  const heard = mission?.told[robot.id] ?? robot.heard;
  return {
    robot,
    mission,
    status: mission?.status[robot.id],
    waiting: missions.filter((one) => WAITING.has(one.phase) && has(one)),
    age: heard === null ? null : clock.age(heard * 1e9),
  };
}

/** Whether an account may command a drone in flight; the server asks the same of each command. */
function mayCommand(account: AccountOut, { mission, status }: Row): boolean {
  if (!mission || !status || account.role === "viewer" || !account.scopes.includes("fly")) return false;
  return account.role !== "pilot" || mission.tenant === account.tenant;
}

function spotOf({ robot, status }: Row): Spot | null {
  const [east, north, up] = status?.position ?? robot.position ?? [];
  return east == null || north == null ? null : [east, north, up ?? 0];
}

function GroupCommands(props: {
  /** Whether some are selected, not all meant. */
  some: boolean;
  count: number;
  reached: boolean;
  onCommand(word: Word): void;
}) {
  const { some, count, reached, onCommand } = props;
  const [sure, setSure] = useState(false);
  useEffect(() => {
    if (!sure) return;
    const timer = setTimeout(() => setSure(false), SURE);
    return () => clearTimeout(timer);
  }, [sure]);
  useEscape(sure ? () => setSure(false) : null);
  const whom = some ? String(count) : "all";
  return (
    <div class="commands group">
      <button
        type="button"
        class="command pause"
        title="Each drone in flight that you may command hovers until told to resume"
        disabled={count === 0 || !reached}
        onClick={() => onCommand("pause")}
      >
        Hold {whom}
      </button>
      <button
        type="button"
        class="command return-home"
        title="Each drone in flight that you may command flies back to its take-off and lands"
        disabled={count === 0 || !reached}
        onClick={() => {
          if (sure) onCommand("return-home");
          setSure(!sure);
        }}
      >
        Return {whom}
        {sure && `: ${count}, sure?`}
      </button>
    </div>
  );
}

/** How far a command for several drones has come, by their answers and by what they are seen to do. */
function OrderText({ order, rows }: { order: GroupOrder; rows: Row[] }) {
  const { word, robots, accepted, refused } = order;
  const obeys = ({ robot, status }: Row) =>
    accepted.has(robot.id) && (status === undefined || SEEN[word](status));
  const done = rows.filter(obeys).length;
  const said = [
    `${accepted.size} of ${robots.length} accepted`,
    `${done} done`,
    ...[...refused].map(([robot, why]) => `${robot}: ${why}`),
  ].join("; ");
  const stage = refused.size > 0 ? "refused" : done === robots.length ? "done" : "accepted";
  return (
    <p class={`order ${stage}`} data-stage={stage} title={said}>
      <strong>
        {NAMES[word]} {robots.join(", ")}
      </strong>{" "}
      {said}
    </p>
  );
}

function FleetMap(props: {
  rows: Row[];
  areas: ReturnType<typeof areasOf>;
  place: Place;
  scenery: ReturnType<typeof useScenery>;
  trails: Map<string, Spot[]>;
  token: string;
  chosen: string | null;
  reached: boolean;
  onChoose(id: string | null): void;
}) {
  const { rows, areas, place, chosen, reached } = props;
  const fitted = useMemo<Point[]>(
    () => [[0, 0], ...place.starts, ...place.fences.flatMap((one) => one.polygon)],
    [place],
  );
  const focus = rows.find((row) => row.robot.id === chosen);
  const spot = focus ? spotOf(focus) : null;
  return (
    <MapView
      label="Map of the fleet. Arrow keys move it, plus and minus zoom, 0 shows all, F follows the chosen drone, T tilts the view, Enter chooses the drone at the cross."
      scenery={props.scenery}
      token={props.token}
      fitted={fitted}
      followed={spot ? [spot[0], spot[1]] : null}
      keys={{}}
      onPoint={([east, north], sight) => {
        const far = (row: Row) => {
          const [e, n] = spotOf(row) ?? [Infinity, Infinity];
          return sight.view.scale * Math.hypot(e - east, n - north);
        };
        const [nearest] = [...rows].sort((one, other) => far(one) - far(other));
        props.onChoose(nearest && far(nearest) < NEAR ? nearest.robot.id : null);
      }}
      buttons={null}
      below={
        <ul class="legend" aria-label="Legend">
          <li class="good">in flight</li>
          <li class="warn">holds, returns</li>
          <li class="bad">lost, aborted</li>
          <li class="muted">on the ground</li>
          <li class="fenced">fence</li>
          <li class="forbidden">no-fly</li>
          {areas.length > 0 && (
            <li class="leased">
              lease<span class="unseen">: {areas.map((one) => one.title).join("; ")}</span>
            </li>
          )}
        </ul>
      }
    >
      {(sight) => (
        <>
          <PlaceLayer place={place} areas={areas} sight={sight} />
          {rows.map((row, place) => {
            const { robot, status } = row;
            const known = { position: robot.position, velocity: null, yaw: null, position_sigma: null };
            return (
              <g key={robot.id} class={`robot ${toneOf(row) || "muted"}`}>
                <polyline class="trail" points={sight.line(props.trails.get(robot.id) ?? [])} />
                {status &&
                  (robot.id === chosen ? (
                    <Plan status={status} sight={sight} />
                  ) : (
                    <Way status={status} sight={sight} />
                  ))}
                <Drone
                  name={robot.id}
                  status={status ?? known}
                  sight={sight}
                  chosen={robot.id === chosen}
                  stale={!reached || isOld(row)}
                  below={!status && place % 2 === 1}
                />
              </g>
            );
          })}
        </>
      )}
    </MapView>
  );
}

function isOld({ status, age }: Row): boolean {
  return status !== undefined && age !== null && age / 1000 > OLD;
}

function toneOf({ robot, status }: Row): string {
  if (robot.link === "lost") return "bad";
  return status ? tone(status) : "";
}

function stateOf({ robot, status, mission }: Row): string {
  if (status) return status.state.replaceAll("_", " ");
  if (mission) return "starting";
  if (!robot.enabled) return "out of service";
  if (robot.link === "lost") return "lost";
  return robot.lease === null ? "free" : "leased";
}

/** What a drone does next. */
function nextOf({ robot, status, waiting }: Row): string {
  if (status && ending(status)) return status.state === "returning" ? "lands at home" : "";
  if (status) {
    const [first, ...more] = aheadOf(status);
    if (status.pilot) return `flown by hand by ${status.pilot}`;
    if (first === undefined) return "no waypoint ahead";
    return `${first}${more.length > 0 ? `, then ${more.length} more` : ""}`;
  }
  const [first] = waiting;
  if (first) return `${first.name}: ${first.phase.replaceAll("_", " ")}`;
  return robot.objection;
}

function ago(age: number | null): string {
  if (age === null) return "—";
  const seconds = age / 1000;
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(0)} h`;
}

const COLUMNS = ["Drone", "State", "Mission", "Tenant", "Charge", "Link", "Age", "Next"];

function Table(props: {
  rows: Row[];
  /** Drones that the account may command now. */
  commanded: ReadonlySet<string>;
  chosen: string | null;
  selected: ReadonlySet<string>;
  onChoose(id: string): void;
  onSelect(id: string): void;
  onMission(id: string): void;
}) {
  const { rows, commanded, chosen, selected } = props;
  return (
    <section class="card drones" aria-label="Drones" tabIndex={0}>
      <table data-testid="fleet">
        <thead>
          <tr>
            <th scope="col">
              <span class="unseen">Selected</span>
            </th>
            {COLUMNS.map((name) => (
              <th key={name} scope="col">
                {name}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => {
            const { robot, mission, status } = row;
            const charge = status?.battery ?? robot.battery;
            return (
              <tr
                key={robot.id}
                data-row={robot.id}
                class={`${robot.id === chosen ? "chosen" : ""} ${isOld(row) ? "stale" : ""}`}
              >
                <td class="select">
                  <input
                    type="checkbox"
                    aria-label={`Select ${robot.id}`}
                    checked={selected.has(robot.id)}
                    disabled={!commanded.has(robot.id)}
                    onChange={() => props.onSelect(robot.id)}
                  />
                </td>
                <th scope="row">
                  <button type="button" class="plain" onClick={() => props.onChoose(robot.id)}>
                    {robot.id}
                  </button>
                </th>
                <td data-label="State">
                  <span class={`badge ${toneOf(row)}`}>{stateOf(row)}</span>
                </td>
                <td data-label="Mission">
                  {mission ? (
                    <button type="button" class="plain" onClick={() => props.onMission(mission.id)}>
                      {mission.name}
                    </button>
                  ) : (
                    "—"
                  )}
                </td>
                <td data-label="Tenant">{mission?.tenant ?? robot.tenant ?? "—"}</td>
                <td data-label="Charge" class={charge !== null && charge < 0.3 ? "bad" : ""}>
                  {charge === null ? "—" : `${(100 * charge).toFixed(0)} %`}
                </td>
                <td data-label="Link" class={robot.link === "lost" ? "bad" : ""}>
                  {LINKS[robot.link]}
                </td>
                <td data-label="Age" class={isOld(row) ? "bad" : ""}>
                  {ago(row.age)}
                </td>
                <td data-label="Next" class="next">
                  {nextOf(row) || "—"}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </section>
  );
}

/** The chosen drone: why it is as it is, and its list before take-off while it stands. */
function Chosen(props: { row: Row; token: string; onMission(id: string): void }) {
  const { robot, mission, status } = props.row;
  const said = [status?.reason ?? "", ...robot.faults, robot.objection].filter(Boolean);
  return (
    <section class="card chosendrone" aria-label="Chosen drone">
      <header>
        <h2>{robot.id}</h2>
        <span class={`badge ${toneOf(props.row)}`}>{stateOf(props.row)}</span>
        {!mission && robot.preflight && <Badge verdict={robot.preflight} />}
        {mission && (
          <button type="button" class="primary" onClick={() => props.onMission(mission.id)}>
            Open its flight
          </button>
        )}
      </header>
      {said.map((text) => (
        <p key={text} class="why">
          {text}
        </p>
      ))}
      {!mission && <PreflightPanel robot={robot.id} token={props.token} live open />}
    </section>
  );
}

function Missions(props: { missions: MissionOut[]; onMission(id: string): void }) {
  const rank = ({ phase }: MissionOut) => (phase === "flying" ? 0 : WAITING.has(phase) ? 1 : 2);
  const ordered = [...props.missions].sort((one, other) => rank(one) - rank(other));
  return (
    <section class="card missions" aria-label="Missions">
      <h2>Missions</h2>
      <ul>
        {ordered.map((one) => (
          <li key={one.id}>
            <button type="button" onClick={() => props.onMission(one.id)}>
              <span>
                <strong>{one.name}</strong> {one.robots.join(", ")}{" "}
                <span class={`badge ${PHASES[one.phase] ?? ""}`}>{one.phase.replaceAll("_", " ")}</span>
              </span>
              <small>
                {timesOf(one)} · {one.account}, {one.tenant}
                {one.reason && ` · ${one.reason}`}
              </small>
            </button>
          </li>
        ))}
        {ordered.length === 0 && <li class="empty">No mission yet</li>}
      </ul>
    </section>
  );
}

const PHASES: Partial<Record<MissionOut["phase"], string>> = {
  flying: "good",
  awaiting_approval: "warn",
  failed: "bad",
  refused: "bad",
};

/** When a mission began and how long it flew, or when it was submitted. */
function timesOf({ submitted, started, ended }: MissionOut): string {
  const from = new Date(1000 * (started ?? submitted));
  const today = from.toDateString() === new Date().toDateString();
  const at = today ? from.toLocaleTimeString() : from.toLocaleString();
  if (started === null) return `submitted ${at}`;
  if (ended === null) return `since ${at}`;
  const minutes = (ended - started) / 60;
  return `${at}, ${minutes < 2 ? `${(60 * minutes).toFixed(0)} s` : `${minutes.toFixed(0)} min`}`;
}
