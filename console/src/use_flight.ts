// A flight as a component follows it.

import { useCallback, useEffect, useState } from "preact/hooks";
import { Flight } from "./flight";
import type { Source } from "./source";
import type { MissionOut } from "./wire";

/** Follow a mission, drawing again at each change; null before the first one. */
export function useFlight(first: MissionOut, token: string, open: () => Source): Flight | null {
  const [, draw] = useState(0);
  const [flight, setFlight] = useState<Flight | null>(null);
  const changed = useCallback(() => draw((count) => count + 1), []);
  useEffect(() => {
    const made = new Flight(first, open(), token, changed);
    setFlight(made);
    // Silence has to show, too.
    const timer = setInterval(changed, 500);
    return () => {
      clearInterval(timer);
      made.close();
    };
  }, [first.id, token, changed]);
  return flight;
}
