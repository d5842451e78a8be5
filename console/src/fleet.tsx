// The first page of a provider: all drones on one map and in one table, their alerts and missions, and
// commands for several drones at once.

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import "./fleet.css";
import { Alerts } from "./alerts";
import { Camera } from "./camera";
import { Bar, CommandButtons, CommandLog } from "./commands";
import { type Flight, type Vehicle, aheadOf, chargeOf, concerns, idsOf, isEnding, useFlight } from "./flight";
import { FlightMap } from "./map";
import { Page, Silence } from "./page";
import { type LeasedArea, robotsOf } from "./place";
import { PreflightBadge, PreflightPanel } from "./preflight";
import { useScenery } from "./scenery";
import { FleetSource } from "./source";
import { Badge, Button, Card, LOW, useEscape } from "./widgets";
import { lasting, wordsOf } from "./words";
import type { AccountOut, FleetOut, MissionOut, RobotOut } from "./wire";

const WAITING = new Set<MissionOut["phase"]>(["submitted", "rehearsing", "awaiting_approval", "queued"]);
const LINKS: Record<RobotOut["link"], string> = {
  unwatched: "not watched",
  connecting: "connecting",
  connected: "connected",
  mission: "up",
  lost: "lost",
};

/** A drone with the mission that flies it, as far as the account sees that. */
interface Row extends Vehicle {
  robot: RobotOut;
  mission: MissionOut | undefined;
  /** The first mission that waits for it. */
  waiting: MissionOut | undefined;
  /** Milliseconds since it was heard; null if it never was. */
  age: number | null;
}

function rowsOf(flight: Flight): Row[] {
  return flight.vehicles().flatMap((vehicle) => {
    const robot = flight.robots.find((one) => one.id === vehicle.id);
    if (!robot) return [];
    const waiting = flight.missions.find((one) => WAITING.has(one.phase) && concerns(one, vehicle.id));
    const mission = flight.missionOf(vehicle.id);
    return [{ ...vehicle, robot, mission, waiting, age: flight.age(vehicle.id) }];
  });
}

interface FleetProps {
  account: AccountOut;
  fleet: FleetOut;
  missions: MissionOut[];
  now: number | null;
  areas: LeasedArea[];
  title: ComponentChildren;
  onMission(id: string): void;
}

export function FleetPage(props: FleetProps) {
  const { account, fleet, missions, now, areas, onMission } = props;
  const [source] = useState(() => new FleetSource());
  const flight = useFlight("fleet", [], () => source);
  const [chosen, setChosen] = useState<string | null>(null);
  const [selected, setSelected] = useState<ReadonlySet<string>>(new Set());
  const robots = robotsOf(fleet);
  const scenery = useScenery("v1/fleet/scenery");
  useEffect(() => source.update({ missions, robots: fleet.robots, now }), [flight, missions]);
  useEscape(selected.size > 0 ? () => setSelected(new Set()) : null);
  if (!flight) return null;

  const rows = rowsOf(flight);
  const commanded = rows.filter((row) => mayCommand(account, row)).map((row) => row.id);
  const group = commanded.filter((id) => selected.size === 0 || selected.has(id));
  const toggle = (id: string) =>
    setSelected(new Set(selected.has(id) ? [...selected].filter((one) => one !== id) : [...selected, id]));
  const focus = rows.find((row) => row.id === chosen);
  const lost = rows.filter(({ robot }) => robot.link === "lost").length;
  const asking = missions.find((one) => one.phase === "awaiting_approval");
  const bar = (
    <>
      <strong>{rows.length} drones</strong>
      <span class="figures">{rows.filter((row) => row.status).length} in flight</span>
      {lost > 0 && <Badge tone="bad">{lost} lost</Badge>}
      {asking && <Button class="plain" onClick={() => onMission(asking.id)}>Review {asking.name}</Button>}
    </>
  );
  return (
    <Page title={props.title} who={`${account.name}, ${account.role}`} flight={flight}>
      <Silence flight={flight} unreachable="Commands cannot reach the drones." />
      <Bar label="Fleet" flight={flight} now={bar}>
        <CommandButtons
          key={group.join()}
          words={["pause", "return-home"]}
          confirmed={["return-home"]}
          whom={selected.size > 0 ? String(group.length) : "all"}
          disabled={() => group.length === 0 || flight.stale}
          onCommand={(word) => flight.command(group, word)}
        />
      </Bar>
      <main class="panels fleet">
        <div class="wide">
          <FlightMap {...{ flight, robots, scenery, areas, chosen }} onChoose={setChosen} />
          <Table
            {...{ rows, commanded, chosen, selected, onMission }}
            onChoose={setChosen}
            onSelect={toggle}
          />
        </div>
        <div class="side">
          <Alerts log={flight.log} onAcknowledge={flight.acknowledge} />
          {focus && <Chosen key={`${focus.id} ${focus.mission?.id}`} {...{ flight, account, onMission }} row={focus} />}
          <Card kind="" label="Missions">
            <Missions missions={missions} onMission={onMission} />
          </Card>
          <CommandLog flight={flight} mayFly />
        </div>
      </main>
    </Page>
  );
}

/** Whether an account may command a drone in flight; the server asks the same of each command. */
function mayCommand({ role, scopes, tenant }: AccountOut, { mission, status }: Row): boolean {
  if (!mission || !status || role === "viewer" || !scopes.includes("fly")) return false;
  return role !== "pilot" || mission.tenant === tenant;
}

function stateOf({ robot, status, mission }: Row): string {
  if (status) return wordsOf(status.mission.state);
  if (mission) return "starting";
  if (!robot.enabled) return "out of service";
  if (robot.link === "lost") return "lost";
  return robot.lease === null ? "free" : "leased";
}

/** What a drone does next. */
function nextOf({ robot, status, waiting }: Row): string {
  if (status) {
    if (isEnding(status)) return status.mission.state === "returning" ? "lands at home" : "";
    if (status.mission.pilot) return `flown by hand by ${status.mission.pilot}`;
    const [first, ...more] = idsOf(aheadOf(status));
    if (first === undefined) return "no waypoint ahead";
    return `${first}${more.length > 0 ? `, then ${more.length} more` : ""}`;
  }
  return waiting ? `${waiting.name}: ${wordsOf(waiting.phase)}` : robot.objection;
}

/** A row's badge of its state. */
function State({ row }: { row: Row }) {
  return <Badge tone={row.tone}>{stateOf(row)}</Badge>;
}

const COLUMNS = ["State", "Mission", "Tenant", "Charge", "Link", "Age", "Next"] as const;

interface TableProps {
  rows: Row[];
  /** Drones that the account may command now. */
  commanded: string[];
  chosen: string | null;
  selected: ReadonlySet<string>;
  onChoose(id: string): void;
  onSelect(id: string): void;
  onMission(id: string): void;
}

function Table({ rows, commanded, chosen, selected, onChoose, onSelect, onMission }: TableProps) {
  return (
    <section class="card drones" aria-label="Drones" tabIndex={0}>
      <table data-testid="fleet">
        <thead>
          <tr>
            <th scope="col">
              <span class="unseen">Selected</span>
            </th>
            {["Drone", ...COLUMNS].map((name) => (
              <th key={name} scope="col">{name}</th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <tr
              key={row.id}
              data-row={row.id}
              class={`${row.id === chosen ? "chosen" : ""} ${row.stale ? "stale" : ""}`}
            >
              <td class="select">
                <input
                  type="checkbox"
                  aria-label={`Select ${row.id}`}
                  checked={selected.has(row.id)}
                  disabled={!commanded.includes(row.id)}
                  onChange={() => onSelect(row.id)}
                />
              </td>
              <th scope="row">
                <Button class="plain" onClick={() => onChoose(row.id)}>{row.id}</Button>
              </th>
              {COLUMNS.map((name) => {
                const [content, kind = ""] = cellsOf(row, onMission)[name];
                return (
                  <td key={name} data-label={name} class={kind}>{content || "—"}</td>
                );
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

/** What stands in a row's cells, and their classes. */
function cellsOf(
  row: Row,
  onMission: (id: string) => void,
): Record<(typeof COLUMNS)[number], [content: ComponentChildren, kind?: string]> {
  const { robot, mission, status } = row;
  const charge = chargeOf(status) ?? robot.battery;
  const open = mission && (
    <Button class="plain" onClick={() => onMission(mission.id)}>{mission.name}</Button>
  );
  return {
    State: [<State row={row} />],
    Mission: [open],
    Tenant: [mission?.tenant ?? robot.tenant],
    Charge: [charge === null ? "" : `${(100 * charge).toFixed(0)} %`, charge !== null && charge < LOW ? "bad" : ""],
    Link: [LINKS[robot.link], robot.link === "lost" ? "bad" : ""],
    Age: [row.age === null ? "" : lasting(row.age / 1000), row.stale ? "bad" : ""],
    Next: [nextOf(row), "next"],
  };
}

/** The chosen drone: its reasons, its camera in flight, and its list before take-off while it stands. */
function Chosen(props: { flight: Flight; account: AccountOut; row: Row; onMission(id: string): void }) {
  const { flight, account, row, onMission } = props;
  const { robot, mission, status } = row;
  const reasons = [status?.mission.reason ?? "", ...robot.faults, robot.objection].filter(Boolean);
  const head = (
    <>
      <State row={row} />
      {!mission && robot.preflight && <PreflightBadge verdict={robot.preflight} />}
      {mission && <Button class="primary" onClick={() => onMission(mission.id)}>Open its flight</Button>}
    </>
  );
  const filmed = mission && account.scopes.includes("sense") && Object.values(mission.streams).includes("pictures");
  return (
    <>
      <Card kind="chosendrone" label="Chosen drone" title={robot.id} head={head}>
        {reasons.map((text) => (
          <p key={text} class="why">{text}</p>
        ))}
        {!mission && <PreflightPanel robot={robot.id} live open />}
      </Card>
      {filmed && <Camera flight={flight} mission={mission} robot={robot.id} />}
    </>
  );
}

/** Missions; first those that await an approval, then those in flight. */
export function Missions({ missions, onMission }: { missions: MissionOut[]; onMission(id: string): void }) {
  const rank = ({ phase }: MissionOut) =>
    phase === "awaiting_approval" ? 0 : phase === "flying" ? 1 : WAITING.has(phase) ? 2 : 3;
  const ordered = [...missions].sort((one, other) => rank(one) - rank(other));
  if (ordered.length === 0) return <p class="empty">No mission yet: the first one appears here.</p>;
  return (
    <ul class="missions">
      {ordered.map((one) => (
        <li key={one.id}>
          <Button class={one.phase} onClick={() => onMission(one.id)}>
            <span>
              <strong>{one.name}</strong> {one.robots.join(", ")}{" "}
              <Badge tone={PHASES[one.phase] ?? ""}>{wordsOf(one.phase)}</Badge>
            </span>
            <small>
              {timesOf(one)} · {one.account}, {one.tenant}
              {one.reason && ` · ${one.reason}`}
            </small>
            {one.phase === "awaiting_approval" && <span class="review">Review it</span>}
          </Button>
        </li>
      ))}
    </ul>
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
  return `${at}, ${lasting(ended - started)}`;
}
