// Where no cell is shown, the count of open alarms is live all the same, and the page says when the service is away.
import { follow } from "./live.js";

follow("/live/alarms", {});
