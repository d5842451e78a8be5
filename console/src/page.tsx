// The frame of each page: its header with badges and colours, and what it says while nothing new arrives.

import { type ComponentChildren, createContext } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import type { Flight } from "./flight";
import { Badge, Button } from "./widgets";

const THEMES = ["auto", "light", "dark"] as const;
type Choice = (typeof THEMES)[number];
const KEPT = "aerodaas.theme";
const SIGNS: Record<Choice, string> = { auto: "◐", light: "☀", dark: "☾" };
const DARK = matchMedia("(prefers-color-scheme: dark)");

interface Colours {
  choice: Choice;
  /** The colours that are shown. */
  shown: string;
  choose(choice: Choice): void;
}

export const Theme = createContext<Colours>({ choice: "auto", shown: "light", choose: () => undefined });

/** The colours that were chosen, and those that are shown. */
export function useTheme(): Colours {
  const kept = localStorage.getItem(KEPT);
  const [choice, choose] = useState<Choice>(THEMES.find((one) => one === kept) ?? "auto");
  const [dark, setDark] = useState(() => DARK.matches);
  useEffect(() => {
    const watch = () => setDark(DARK.matches);
    DARK.addEventListener("change", watch);
    return () => DARK.removeEventListener("change", watch);
  }, []);
  useEffect(() => {
    localStorage.setItem(KEPT, choice);
    document.documentElement.dataset["theme"] = choice;
  }, [choice]);
  return { choice, choose, shown: choice === "auto" && dark ? "dark" : choice };
}

export function ThemeButton() {
  const { choice, choose } = useContext(Theme);
  return (
    <Button
      class="plain theme"
      title={`Colours: ${choice}. Click to change`}
      label={`Colours: ${choice}`}
      onClick={() => choose(THEMES[(THEMES.indexOf(choice) + 1) % THEMES.length] ?? "auto")}
    >
      {SIGNS[choice]}
    </Button>
  );
}

interface PageProps {
  /** What is shown, or the choice of it. */
  title: ComponentChildren;
  /** Whose page it is. */
  who: string;
  flight: Flight;
  children: ComponentChildren;
}

export function Page({ title, who, flight, children }: PageProps) {
  return (
    <div class={`page ${flight.recorded ? "played" : ""}`}>
      <header class="top">
        <h1>AeroDaaS</h1>
        {title}
        <span class="grow" />
        {who && <Badge tone={flight.source.kind === "fleet" ? "who" : ""}>{who}</Badge>}
        <Connection flight={flight} />
        <ThemeButton />
      </header>
      {children}
    </div>
  );
}

function Connection({ flight }: { flight: Flight }) {
  const lost = flight.connected ? "silent" : "not connected";
  const [tone, text] = flight.recorded
    ? ["", "recording"]
    : flight.over
      ? ["", "over"]
      : flight.stale
        ? ["bad", lost]
        : ["good", "live"];
  return (
    <Badge tone={tone} testid="connection">{text}</Badge>
  );
}

/** Since when nothing has arrived; `unreachable` says that commands do not arrive either. */
export function Silence({ flight, unreachable }: { flight: Flight; unreachable: string }) {
  if (!flight.stale) return null;
  const seconds = ((Date.now() - flight.heard) / 1000).toFixed(0);
  const whose = flight.source.kind === "fleet" ? "The service" : "The flight";
  return (
    <p class="banner bad" role="alert" data-testid="banner">
      {whose} has been silent for {seconds} s: this page shows old data. {unreachable}
      {!flight.connected && " Reconnecting…"}
    </p>
  );
}
