// The console: signs in, and shows the fleet, one mission, or two recordings side by side.

import "./console.css";
import "./piloting.css";
import { render } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import {
  Refused,
  answered,
  ask,
  keepToken,
  messageOf,
  readFragment,
  token as keptToken,
  usePolled,
  writeFragment,
} from "./connection";
import { FleetPage, Missions } from "./fleet";
import { FlightPage, SideBySide } from "./flight_page";
// After the pages whose styles it adds to.
import { ApprovalPage } from "./approval";
import { Theme, ThemeButton, useTheme } from "./page";
import { areasOf } from "./place";
import { Recorded } from "./recorded";
import { Select, useEvent } from "./widgets";
import { wordsOf } from "./words";
import type { AccountOut, FleetOut, MissionOut } from "./wire";

/** Milliseconds between two requests of the missions, and of the fleet while that is shown. */
const PAUSE = 2000;
const FLEET_PAUSE = 1000;
/** Tenant of a flight of one's own. */
const OWN = "own";

interface State {
  account: AccountOut;
  fleet: FleetOut;
  missions: MissionOut[];
  /** The server's time, nanoseconds. */
  now: number | null;
}

async function stateOf(signal: AbortSignal): Promise<State> {
  const [account, answer, missions] = await Promise.all([
    ask<AccountOut>("v1/me", undefined, signal),
    answered("v1/fleet", undefined, signal),
    ask<MissionOut[]>("v1/missions", undefined, signal),
  ]);
  const date = Date.parse(answer.headers.get("Date") ?? "");
  const fleet = (await answer.json()) as FleetOut;
  return { account, fleet, missions, now: Number.isNaN(date) ? null : date * 1e6 };
}

function App() {
  const [token, setToken] = useState(keptToken);
  /** Why the last token was refused. */
  const [refusal, setRefusal] = useState("");
  const [chosen, setChosen] = useState<string | null>(() => readFragment("mission"));
  /** The mission that was seen flying: its end is shown before its recording. */
  const [seen, setSeen] = useState<string | null>(null);
  /** The mission whose recording is played beside the chosen one's. */
  const [beside, setBeside] = useState(() => readFragment("beside"));
  const overview = useRef(false);
  const { answer, at, error } = usePolled(token, stateOf, () => (overview.current ? FLEET_PAUSE : PAUSE));
  const areas = useMemo(() => areasOf(answer?.fleet.robots ?? []), [answer]);

  const missions = answer?.missions ?? [];
  /** Whether this is a provider's page, with a fleet and other missions than one's own. */
  const provided = answer !== null && answer.account.tenant !== OWN;
  // A provider's first page is its fleet; elsewhere the only mission is shown at once.
  const only = !provided && missions.length === 1 ? missions[0] : undefined;
  const shown = chosen ?? (only?.phase === "flying" || only?.recording ? only.id : null);
  const mission = missions.find((one) => one.id === shown);
  overview.current = provided && mission === undefined;
  useEffect(() => {
    if (!(error instanceof Refused) || error.status !== 401) return;
    setToken("");
    setRefusal(error.message);
  }, [error]);
  // A mission that is shown stays shown after it is over.
  useEffect(() => {
    if (chosen === null && shown !== null) setChosen(shown);
  }, [chosen, shown]);
  useEffect(() => {
    if (mission?.phase === "flying") setSeen(mission.id);
  }, [mission?.id, mission?.phase, seen]);
  const choose = (id: string) => {
    setSeen(null);
    // An empty one is none: the fleet is shown, whatever flies.
    setChosen(id);
    setBeside(null);
    writeFragment({ mission: id, t: null, beside: null });
  };
  // A link that is opened in this tab changes the fragment alone.
  useEvent("hashchange", () => {
    const linked = readFragment("mission");
    if (linked && linked !== chosen) choose(linked);
  });
  const compare = (id: string) => {
    setBeside(id);
    writeFragment({ beside: id });
  };

  const problem = error === null ? "" : messageOf(error);
  if (!token) return <SignIn problem={refusal} onToken={setToken} />;
  if (answer && mission) {
    const { account, fleet } = answer;
    const recordings = missions.filter((one) => one.recording && one !== mission);
    const page = {
      ...{ first: mission, account, fleet, areas, answeredAt: at },
      ...{ others: recordings, onBeside: compare },
      onReplay: mission.recording ? () => choose(mission.id) : undefined,
      title:
        missions.length > 1 || provided ? (
          <MissionChoice chosen={mission.id} fleet={provided} missions={missions} onMission={choose} />
        ) : (
          <strong class="name">{mission.name}</strong>
        ),
    };
    if (provided && mission.started === null) {
      return (
        <ApprovalPage key={mission.id} {...page} onMission={choose}>
          <FlightPage {...page} />
        </ApprovalPage>
      );
    }
    const replayed = mission.recording && account.scopes.includes("sense");
    if (!replayed || seen === mission.id) return <FlightPage key={mission.id} {...page} />;
    const other = recordings.find((one) => one.id === beside);
    return (
      <Recorded key={`${mission.id} ${other?.id}`} mission={mission}>
        {(left) =>
          other ? (
            <Recorded key={other.id} mission={other}>
              {(right) => (
                <SideBySide missions={[mission, other]} recorded={[left, right]} onAlone={choose} />
              )}
            </Recorded>
          ) : (
            <FlightPage {...page} recorded={left} />
          )
        }
      </Recorded>
    );
  }
  if (answer && provided) {
    const title = <MissionChoice chosen="" fleet missions={missions} onMission={choose} />;
    return <FleetPage {...answer} title={title} areas={areas} onMission={choose} />;
  }
  return (
    <main class="start">
      <h1>AeroDaaS console</h1>
      {problem && <p class="banner bad">{problem}</p>}
      {answer ? <Missions missions={missions} onMission={choose} /> : <p>Connecting…</p>}
      <ThemeButton />
    </main>
  );
}

function MissionChoice(props: {
  missions: MissionOut[];
  chosen: string;
  /** Whether there is a fleet to choose, too. */
  fleet: boolean;
  onMission(id: string): void;
}) {
  const { missions, chosen, fleet, onMission } = props;
  const named = missions.map((one): [string, string] => [one.id, `${one.name} · ${wordsOf(one.phase)}`]);
  const options = fleet ? [["", "the fleet"] as [string, string], ...named] : named;
  return <Select label="Mission" value={chosen} options={options} onChoose={onMission} />;
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
        <button type="submit" class="primary">Open</button>
        <p class="hint">
          The address that a flight of your own prints contains its token. A provider's administrator
          gives you yours.
        </p>
      </form>
    </main>
  );
}

function Root() {
  const theme = useTheme();
  return (
    <Theme.Provider value={theme}>
      <App />
    </Theme.Provider>
  );
}

const root = document.getElementById("console");
if (root) render(<Root />, root);
