"""An OPC UA server's services, on asyncua's types, codec and cryptography; it knows nothing of what it shows.

asyncua keeps what it does well: the types and the binary codec, the cryptography of secure channels, the
standard address space, the import of NodeSet2 files. Its classes are used as they are and none is patched,
but for the decoder of null arrays (`asyncua_adapter.bound_null_arrays`). Its service layer is not used at
all: the modules here take its place, and each says what it does better. Names are those of the standard:
services and parameters of Part 4, aggregates of Part 13, history of Part 11.

The entry point is `service_host.ServiceHost`: who uses the server gives it an address space, methods and the
answers of `host_interface`, and starts it. Below it, from the wire inwards:

===========================  ==============================================================================
**here**
`service_host`               puts listener, services and clock together
`server_description`         what it tells of itself: what it is, and the limits that hold
`host_interface`             settings, limits, and what the server asks of its host
`asyncua_adapter`            all that is used of asyncua beside its public types
`languages`                  texts in the language of a session, by its LocaleIds
`binary_codec`               requests and responses as bytes; one exception for what cannot be read
`loop_share`                 how long any one request may keep the event loop
`session_service`            CreateSession, ActivateSession, CloseSession: no session without encryption,
                             certificates and signatures compared
`continuation_points`        of Browse and HistoryRead, and when they expire
`event_notification`         an event as it is reported to those who listen
`fan_out`                    what many listen to is told in slices
**transport**
`message_frames`             the stream cut into frames; refuses malformed Hellos and oversized messages
`tcp_connection`             frames in and out; refuses half-open connections, clients that do not read
`connection_table`           which connections there are, and what they may hold together
`secure_channel`             trust checked before a channel opens; renewal; limits
**certificates**
`trust_list`                 the folders of certificates, and who may connect
`own_certificate`            the server's certificate and key, read as it uses them
`certificate_files`          certificates as they lie in files
`certificate_dates`          which of them have ended, or soon will
`making`                     making certificates
**sessions**
`request_dispatch`           from a request to its service; every fault becomes the standard's status code
`large_requests`             long requests one at a time, and the garbage collector between them
`authentication`             identity tokens into users
`login_throttle`             guessing passwords becomes slow, for who guesses alone
`session_table`              tokens that cannot be guessed, bound to their channel; limits; timeouts
**address_space**
`node_references`            attributes and references of nodes, read and written in place
`type_instances`             objects made from types, with NodeIds that stay the same
`variable_store`             values as they are now, encoded once for all subscribers
**services**
`discovery_service`          GetEndpoints, FindServers
`attribute_service`          Read, Write: index ranges, encodings, timestamps, the reader's own rights
`view_service`               Browse, BrowseNext, TranslateBrowsePathsToNodeIds: continuation points, masks
`method_service`             Call: arguments checked, callers known, methods bound to their objects
**filters**
`data_change_filter`         deadbands, NaN, index ranges
`event_filter`               which events a client wants, and which of their fields
`content_filter`             where clauses, three-valued; OfType with subtypes
`like_pattern`               patterns of the Like operator
**subscriptions**
`subscription_service`       Publish, Republish, TransferSubscriptions; subscriptions belong to their session
`publish_queue`              Publish requests that wait for something to say
`subscription`               publishing cycles, lifetime, MoreNotifications
`monitored_item_service`     items that exist, with the filters they can have
`item_room`                  how many monitored items a user may have
`monitored_item`             queues that tell of overflow
`ready_items`                what goes into one message
`notification_encoding`      publish responses put together from parts encoded once
`retransmission_queue`       messages sent and not yet acknowledged
**history**
`history_service`            HistoryRead: raw values, aggregates, events
`historical_variable`        spans of time, read page by page
`history_processed`          aggregates interval by interval, in one pass over what they need
`history_aggregates`         Average, Minimum, Maximum, Count by their definition
`history_encoding`           answers put together without an object for each value
`read_budget`                how many values one HistoryRead may take, and how long
===========================  ==============================================================================
"""
