"""An OPC UA server's services, on asyncua's types, codec and cryptography; it knows nothing of what it shows.

asyncua keeps what it does well: the types and the binary codec, the cryptography of secure channels, the
standard address space, the import of NodeSet2 files. Its classes are used as they are and none is patched,
but for the decoder of null arrays (`asyncua_adapter.bound_null_arrays`). Its service layer is not used at
all: the modules here take its place, and each says what it does better. Names are those of the standard:
services and parameters of Part 4, aggregates of Part 13, history of Part 11.

Who uses the server gives it an address space, methods and the answers of `host_interface`, and starts a
`service_host.ServiceHost`.

===========================  ==============================================================================
`host_interface`             settings, limits, and what the server asks of its host
`asyncua_adapter`            all that is used of asyncua beside its public types
`binary_codec`               requests and responses as bytes; one exception for what cannot be read
`tcp_connection`             malformed Hello, half-open connections, oversized messages, clients that do not
                             read
`secure_channel`             trust checked before a channel opens; renewal; limits
`trust_list`                 the server's certificate and those it trusts; `certificates` makes them
`request_dispatch`           from a request to its service; every fault becomes the standard's status code
`discovery_service`          GetEndpoints, FindServers
`session_service`            CreateSession, ActivateSession, CloseSession: no session without encryption,
                             certificates and signatures compared
`authentication`             identity tokens into users
`login_throttle`             guessing passwords becomes slow, for who guesses alone
`session_table`              tokens that cannot be guessed, bound to their channel; limits; timeouts;
                             continuation points
`attribute_service`          Read, Write: index ranges, encodings, timestamps, the reader's own rights
`view_service`               Browse, BrowseNext, TranslateBrowsePathsToNodeIds: continuation points, masks
`method_service`             Call: arguments checked, callers known, methods bound to their objects
`variable_store`             values as they are now, encoded once for all subscribers
`subscription_service`       Publish, Republish, TransferSubscriptions; subscriptions belong to their session
`subscription`               publishing cycles, retransmission, lifetime, MoreNotifications
`monitored_item_service`     items that exist, with the filters they can have
`monitored_item`             queues that tell of overflow; `ready_items`: what goes into one message
`data_change_filter`         deadbands, NaN, index ranges
`event_filter`               OfType with subtypes, three-valued where clauses, for `event_notification`
`notification_encoding`      publish responses put together from parts encoded once
`connection_table`           which connections there are, and what they may hold together
`fan_out`                    what many listen to is told in slices; `retransmission_queue`: sent, not yet
                             acknowledged; `item_room`: how many monitored items a user may have
`languages`                  texts in the language of a session, by its LocaleIds
`history_service`            HistoryRead: raw values, aggregates, events
`historical_variable`        spans of time, read page by page
`history_aggregates`         Average, Minimum, Maximum, Count by their definition; `history_processed` reads
                             once through what they need, `history_encoding` puts answers together
`read_budget`                what one HistoryRead may take; `loop_share`: what any request may, at a time
`large_requests`             long requests one at a time, and the garbage collector between them
`type_instances`             objects made from types, with NodeIds that stay the same
`service_host`               listener, services and clock put together
===========================  ==============================================================================
"""
