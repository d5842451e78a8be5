// The console: signs in, chooses a mission, and lays out the panels.

import { render } from "preact";
import { useCallback, useEffect, useState } from "preact/hooks";
import { Charts } from "./charts";
import { Refused, ask, keepToken, takeToken } from "./connection";
import { Flight } from "./flight";
import { FlightMap } from "./map";
import { Alerts, Commands, StatePanel, WaypointForm } from "./panels";
import { type Place, type Point, placeOf } from "./place";
import type { AccountOut, FleetOut, MissionOut } from "./wire";
import { Video } from "./video";
import "./console.css";

const THEMES = ["auto", "light", "dark"] as const;
type Theme = (typeof THEMES)[number];
const LOOK = 2000;

interface Known {
  account: AccountOut;
  place: Place;
  name: string;
}

function App() {
  const [token, setToken] = useState(takeToken);
  const [known, setKnown] = useState<Known | null>(null);
  const [missions, setMissions] = useState<MissionOut[]>([]);
  const [chosen, setChosen] = useState<string | null>(null);
  const [problem, setProblem] = useState("");
  const [theme, setTheme] = useTheme();

  useEffect(() => {
    if (!token) return;
    let gone = false;
    let timer = 0;
    const look = async () => {
      try {
        const [account, fleet, all] = await Promise.all([
          ask<AccountOut>("v1/me", token),
          ask<FleetOut>("v1/fleet", token),
          ask<MissionOut[]>("v1/missions", token),
        ]);
        if (gone) return;
        setKnown((before) => before ?? { account, place: placeOf(fleet), name: fleet.name });
        setMissions(all);
        setProblem("");
      } catch (error) {
        if (gone) return;
        setProblem(error instanceof Error ? error.message : String(error));
        if (error instanceof Refused && error.status === 401) {
          setKnown(null);
          setToken("");
          return;
        }
      }
      timer = setTimeout(() => void look(), LOOK);
    };
    void look();
    return () => {
      gone = true;
      clearTimeout(timer);
    };
  }, [token]);

  const flying = missions.filter((one) => one.phase === "flying");
  const shown = chosen ?? (flying.length === 1 ? flying[0]?.id : undefined) ?? null;
  const mission = missions.find((one) => one.id === shown);
  // A mission that is shown stays shown after it is over.
  useEffect(() => {
    if (chosen === null && shown !== null) setChosen(shown);
  }, [chosen, shown]);

  const themes = (
    <button
      type="button"
      class="plain"
      title="Light, dark, or as the system has it"
      onClick={() => setTheme(THEMES[(THEMES.indexOf(theme) + 1) % THEMES.length] ?? "auto")}
    >
      {theme}
    </button>
  );
  if (!token) return <SignIn problem={problem} onToken={setToken} />;
  if (known && mission) {
    return (
      <Console
        key={mission.id}
        first={mission}
        missions={missions}
        known={known}
        token={token}
        theme={theme}
        themes={themes}
        onMission={setChosen}
      />
    );
  }
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      {known ? <Missions missions={missions} onMission={setChosen} /> : <p>connecting…</p>}
      {themes}
    </main>
  );
}

function SignIn({ problem, onToken }: { problem: string; onToken(token: string): void }) {
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      <form
        class="card"
        onSubmit={(event) => {
          event.preventDefault();
          const token = String(new FormData(event.currentTarget).get("token")).trim();
          keepToken(token);
          onToken(token);
        }}
      >
        <label>
          <span>Token</span>
          <input name="token" type="password" autocomplete="off" required autoFocus />
        </label>
        <button type="submit" class="primary">
          Open
        </button>
        <p class="hint">
          A flight of your own tells its address with the token; a provider's administrator makes
          yours.
        </p>
      </form>
    </main>
  );
}

function Missions(props: { missions: MissionOut[]; onMission(id: string): void }) {
  if (props.missions.length === 0) return <p>No mission yet: this page shows the first one.</p>;
  return (
    <ul class="missions">
      {props.missions.map((one) => (
        <li key={one.id}>
          <button type="button" onClick={() => props.onMission(one.id)}>
            <strong>{one.name}</strong> {one.robots.join(", ")}{" "}
            <span class="badge">{one.phase.replaceAll("_", " ")}</span>
          </button>
        </li>
      ))}
    </ul>
  );
}

interface ConsoleProps {
  first: MissionOut;
  missions: MissionOut[];
  known: Known;
  token: string;
  theme: Theme;
  themes: preact.ComponentChildren;
  onMission(id: string): void;
}

function Console({ first, missions, known, token, theme, themes, onMission }: ConsoleProps) {
  const [, draw] = useState(0);
  const [flight, setFlight] = useState<Flight | null>(null);
  const [robot, setRobot] = useState(first.robots[0] ?? "");
  const [marked, setMarked] = useState<Point | null>(null);
  const changed = useCallback(() => draw((count) => count + 1), []);
  useEffect(() => {
    const made = new Flight(first, token, changed);
    setFlight(made);
    // Silence has to show, too.
    const timer = setInterval(changed, 500);
    return () => {
      clearInterval(timer);
      made.close();
    };
  }, [first.id, token, changed]);
  if (!flight) return null;

  const may = known.account.role !== "viewer" && known.account.scopes.includes("fly");
  const sees = known.account.scopes.includes("sense");
  const status = flight.status(robot);
  const fence = known.place.fences.find((one) => one.robot === robot);
  const height = status?.position?.[2] ?? 0;
  return (
    <div class="page">
      <header class="top">
        <h1>AeroDaaS</h1>
        {missions.length > 1 ? (
          <select
            aria-label="Mission"
            value={first.id}
            onChange={(event) => onMission(event.currentTarget.value)}
          >
            {missions.map((one) => (
              <option key={one.id} value={one.id}>
                {one.name} · {one.phase.replaceAll("_", " ")}
              </option>
            ))}
          </select>
        ) : (
          <strong class="name">{flight.mission.name}</strong>
        )}
        {flight.mission.robots.length > 1 && (
          <select
            aria-label="Drone"
            value={robot}
            onChange={(event) => setRobot(event.currentTarget.value)}
          >
            {flight.mission.robots.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        )}
        <span class="grow" />
        <span class="badge">{known.account.role}</span>
        <Connection flight={flight} />
        {themes}
      </header>
      {flight.stale && (
        <p class="banner bad" role="alert" data-testid="banner">
          No word from the flight for {((Date.now() - flight.heard) / 1000).toFixed(0)} s: what is
          shown is old. Connecting again…
        </p>
      )}
      {flight.over && (
        <p class="banner" role="status" data-testid="banner">
          The flight is over: {flight.mission.phase.replaceAll("_", " ")}
          {flight.mission.reason && `, ${flight.mission.reason}`}
        </p>
      )}
      <main class="panels">
        <FlightMap
          flight={flight}
          place={known.place}
          robot={robot}
          mayFly={may && !flight.over}
          marked={marked}
          onMark={setMarked}
          onRobot={setRobot}
        />
        {marked && (
          <WaypointForm
            key={marked.join()}
            flight={flight}
            robot={robot}
            point={marked}
            height={height > 0.5 ? height : known.place.takeoffHeight}
            ceiling={fence?.ceiling ?? 120}
            onDone={() => setMarked(null)}
          />
        )}
        {sees && <Video flight={flight} token={token} />}
        <StatePanel flight={flight} robot={robot} />
        <Commands flight={flight} robot={robot} mayFly={may} />
        <Charts flight={flight} robot={robot} theme={theme} />
        <Alerts flight={flight} />
      </main>
    </div>
  );
}

function Connection({ flight }: { flight: Flight }) {
  const [tone, text] = flight.over
    ? ["", "over"]
    : flight.stale
      ? ["bad", "not connected"]
      : ["good", "live"];
  return (
    <span class={`badge ${tone}`} data-testid="connection">
      {text}
    </span>
  );
}

function useTheme(): [Theme, (theme: Theme) => void] {
  const kept = localStorage.getItem("aerodaas.theme");
  const [theme, setTheme] = useState<Theme>(THEMES.find((one) => one === kept) ?? "auto");
  useEffect(() => {
    localStorage.setItem("aerodaas.theme", theme);
    document.documentElement.dataset["theme"] = theme;
  }, [theme]);
  return [theme, setTheme];
}

const root = document.getElementById("console");
if (root) render(<App />, root);
