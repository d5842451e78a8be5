// Escape ends what is begun on the page, wherever the focus is.

import { useEffect, useRef } from "preact/hooks";

/** Call `act` when Escape is pressed; null while there is nothing to end. */
export function useEscape(act: (() => void) | null): void {
  const newest = useRef(act);
  newest.current = act;
  const waits = act !== null;
  useEffect(() => {
    if (!waits) return;
    const press = (event: KeyboardEvent) => event.key === "Escape" && newest.current?.();
    addEventListener("keydown", press);
    return () => removeEventListener("keydown", press);
  }, [waits]);
}
